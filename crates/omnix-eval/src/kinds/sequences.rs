//! What the evaluations share: the means of rows, and plots of sequences.

use crate::EvalError;
use crate::plot::{Form, Plot};
use crate::stats::mean_of_numbers;
use crate::table::{Row, Skipped};

/// The mean of rows, number by number; NaN of a number that none has.
pub(super) fn mean(name: impl Into<String>, rows: &[Vec<f64>], columns: usize) -> Row {
    let values = (0..columns).map(|k| mean_of_numbers(rows.iter().map(|row| row[k])).0).collect();
    Row { name: name.into(), count: rows.len(), values }
}

/// An entry of what has no result.
pub(crate) fn skipped(name: &str, error: &dyn std::fmt::Display, counts_as_zero: bool) -> Skipped {
    Skipped { name: name.to_owned(), reason: error.to_string(), counts_as_zero }
}

/// A sequence's result or its own error. Where the network itself failed, no other sequence would fare better.
pub(crate) fn or_fatal<T>(result: Result<T, EvalError>) -> Result<Result<T, EvalError>, EvalError> {
    match result {
        Err(error @ EvalError::Run(_)) => Err(error),
        other => Ok(other),
    }
}

/// No prediction of this name, with the names that are looked for.
pub(super) fn no_prediction(name: &str, layout: &str) -> Skipped {
    let reason = format!("there is no prediction of this name; predictions are {layout}");
    Skipped { name: name.to_owned(), reason, counts_as_zero: false }
}

/// Refuses an evaluation without a single result, naming the first reason.
pub(super) fn not_empty(results: usize, skipped: &[Skipped]) -> Result<(), EvalError> {
    match skipped.first() {
        Some(first) if results == 0 => {
            let more = skipped.len() - 1;
            let more = if more == 0 { String::new() } else { format!(" (and {more} more have no result)") };
            Err(EvalError::Nothing { reason: format!("{}: {}{more}", first.name, first.reason) })
        }
        _ => Ok(()),
    }
}

/// Bars of a column of sequences, the worst first.
pub(super) fn bars(rows: &[Row], column: usize, title: String, y: &'static str, more_is_better: bool) -> Plot {
    let series = rows.iter().map(|row| (row.name.clone(), vec![row.values[column]])).collect();
    Plot { name: "sequences", title, x: "", y, more_is_better, series, form: Form::Bars }
}

/// Errors over frames, a line for each sequence.
pub(super) fn lines(series: Vec<(String, Vec<f64>)>, title: String, y: &'static str) -> Plot {
    Plot { name: "frames", title, x: "frame", y, more_is_better: false, series, form: Form::Lines }
}
