//! The figures of many samples as one report.

use super::{Score, Trivial};
use crate::EvalError;
use crate::stats::mean_of_numbers;
use crate::table::{Column, Protocol, Report, Row, Skipped};

const COLUMNS: [Column; 7] = [
    Column::less("AbsRel", ""),
    Column::more("delta_1.25"),
    Column::less("displacement", ""),
    Column::more("IoU"),
    Column::less("still", ""),
    Column::less("rotation", "deg"),
    Column::less("direction", "deg"),
];

/// Samples evaluated one after another.
#[derive(Debug, Default)]
pub struct Figures {
    names: Vec<String>,
    scores: Vec<Score>,
    trivial: [Vec<Score>; 3],
    skipped: Vec<Skipped>,
}

impl Figures {
    /// Adds a sample's scores ([`super::score`]).
    pub fn add(&mut self, name: &str, (score, trivial): (Score, [Score; 3])) {
        self.names.push(name.to_owned());
        self.scores.push(score);
        for (all, score) in self.trivial.iter_mut().zip(trivial) {
            all.push(score);
        }
    }

    /// A sample that has no result, and why.
    pub fn skip(&mut self, name: &str, reason: String) {
        self.skipped.push(Skipped { name: name.to_owned(), reason, counts_as_zero: false });
    }

    /// The network's figures over all samples so far, by the names of the report's columns; those that no sample has are left out.
    #[must_use]
    pub fn means(&self) -> Vec<(&'static str, f64)> {
        let values = of_all("", &self.scores).values;
        COLUMNS.iter().map(|column| column.name).zip(values).filter(|(_, value)| value.is_finite()).collect()
    }

    /// The report: a row for the network, one for each trivial answer, and one for each sample.
    ///
    /// # Errors
    /// [`EvalError::Nothing`] if no sample has a result.
    pub fn report(self, data_set: String, network: &str) -> Result<Report, EvalError> {
        if self.scores.is_empty() {
            let first = self
                .skipped
                .first()
                .map_or_else(|| "there is no sample".to_owned(), |s| format!("{}: {}", s.name, s.reason));
            return Err(EvalError::Nothing { reason: first });
        }
        let mut rows = vec![of_all(network, &self.scores)];
        rows.extend(Trivial::ALL.iter().map(|which| of_all(which.name(), &self.trivial[*which as usize])));
        let sequences = self
            .names
            .iter()
            .zip(&self.scores)
            .map(|(name, score)| of_all(name, std::slice::from_ref(score)))
            .collect();
        Ok(Report {
            kind: "network",
            protocol: Protocol {
                data_set,
                split: "all samples".into(),
                clips: "the images of a sample".into(),
                frame: "the first camera of prediction and of truth".into(),
                alignment: "one scale for each sample, with the least mean relative error of depth; for the plane over rows two numbers".into(),
                thresholds: "a pixel moves where its score is above 0.5; a point of a still scene moves if it goes further than \
                             0.01 of the mean distance"
                    .into(),
                mask: "pixels with known depth; moving ones by their true paths, seen or hidden".into(),
                mean: "over samples; displacement and IoU of the sums over all samples".into(),
            },
            columns: COLUMNS.to_vec(),
            rows,
            sequences,
            skipped: self.skipped,
            notes: Vec::new(),
            plots: Vec::new(),
        })
    }
}

fn of_all(name: &str, scores: &[Score]) -> Row {
    let mean = |of: fn(&Score) -> f64| mean_of_numbers(scores.iter().map(of)).0;
    let [error, length] = [0, 1].map(|k| scores.iter().map(|score| score.displacement[k]).sum::<f64>());
    let [both, either] = [0, 1].map(|k| scores.iter().map(|score| score.overlap[k]).sum::<u64>() as f64);
    let values = vec![
        mean(|score| score.abs_rel),
        mean(|score| score.delta),
        error / length,
        both / either,
        mean(|score| score.still),
        mean(|score| score.rotation),
        mean(|score| score.direction),
    ];
    Row { name: name.to_owned(), count: scores.len(), values }
}
