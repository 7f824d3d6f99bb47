//! The result of an evaluation as JSON and as Markdown. `eval.md` section 9 says what a result carries.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use omnix_tensors::AtomicFile;
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::digits::number;
use crate::plot::Plot;
use crate::{EvalError, plot};

/// What was compared, and how. Empty fields do not apply.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Protocol {
    /// The data set.
    pub data_set: String,
    /// Its split, or which of its sequences.
    pub split: String,
    /// How sequences were cut into clips.
    pub clips: String,
    /// In which frame positions were compared.
    pub frame: String,
    /// How predictions were brought onto the truth.
    pub alignment: String,
    /// Thresholds and the resolution at which pixels are meant.
    pub thresholds: String,
    /// Which pixels, points or poses were scored.
    pub mask: String,
    /// How means were taken.
    pub mean: String,
}

/// A number of every row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Column {
    /// Its name in JSON and in tables.
    pub name: &'static str,
    /// Its unit; empty for shares and ratios.
    pub unit: &'static str,
    /// Whether more is better.
    pub more_is_better: bool,
}

impl Column {
    /// A column of which less is better.
    #[must_use]
    pub const fn less(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit, more_is_better: false }
    }

    /// A column of which more is better.
    #[must_use]
    pub const fn more(name: &'static str) -> Self {
        Self { name, unit: "", more_is_better: true }
    }
}

/// A line: of a mean, or of one sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// What it is of.
    pub name: String,
    /// Sequences, clips or images that it is of.
    pub count: usize,
    /// One for each column; NaN where there is none.
    pub values: Vec<f64>,
}

/// A sequence that has no result, or counts as zero.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// Its name.
    pub name: String,
    /// Why, as the error says it.
    pub reason: String,
    /// Whether it counts as zero in the means, as a protocol may demand.
    pub counts_as_zero: bool,
}

/// A whole evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// `depth`, `pose`, `tapvid3d` or `trajectories`.
    pub kind: &'static str,
    /// What was compared, and how.
    pub protocol: Protocol,
    /// The numbers of every row.
    pub columns: Vec<Column>,
    /// Means; the first is the one to quote.
    pub rows: Vec<Row>,
    /// Each sequence under the protocol of the first row.
    pub sequences: Vec<Row>,
    /// Sequences without a result.
    pub skipped: Vec<Skipped>,
    /// What else has to be known to read the numbers.
    pub notes: Vec<String>,
    /// Pictures that show where it fails.
    pub plots: Vec<Plot>,
}

impl Report {
    /// The report as JSON. Numbers that are not finite are null.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let row = |row: &Row| {
            let values =
                self.columns.iter().zip(&row.values).map(|(column, value)| (column.name.to_owned(), json!(value)));
            json!({ "name": row.name, "count": row.count, "values": values.collect::<Map<_, _>>() })
        };
        json!({
            "kind": self.kind,
            "protocol": self.protocol,
            "evaluated": self.sequences.len(),
            "skipped": self.skipped,
            "columns": self.columns,
            "means": self.rows.iter().map(row).collect::<Vec<_>>(),
            "sequences": self.sequences.iter().map(row).collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }

    /// The report as Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!("# {}: {}\n\n", self.kind, self.protocol.data_set);
        let fields = [
            ("split", &self.protocol.split),
            ("clips", &self.protocol.clips),
            ("frame", &self.protocol.frame),
            ("alignment", &self.protocol.alignment),
            ("thresholds", &self.protocol.thresholds),
            ("scored", &self.protocol.mask),
            ("means", &self.protocol.mean),
        ];
        // Writing to a string does not fail.
        for (name, value) in fields.iter().filter(|(_, value)| !value.is_empty()) {
            let _ = writeln!(text, "- {name}: {value}");
        }
        let (evaluated, skipped) = (self.sequences.len(), self.skipped.len());
        let _ = writeln!(text, "- sequences: {evaluated} with a result, {skipped} without\n");
        text += &self.rows_as_table("mean", &self.rows);
        if !self.sequences.is_empty() {
            text += "\n## Each sequence\n\n";
            text += &self.rows_as_table("sequence", &self.sequences);
        }
        if !self.skipped.is_empty() {
            text += "\n## Without a result\n\n";
            for skipped in &self.skipped {
                let zero = if skipped.counts_as_zero { " (counts as zero)" } else { "" };
                let _ = writeln!(text, "- {}{zero}: {}", skipped.name, skipped.reason);
            }
        }
        if !self.notes.is_empty() {
            text += "\n## Notes\n\n";
            self.notes.iter().for_each(|note| _ = writeln!(text, "- {note}"));
        }
        text
    }

    fn rows_as_table(&self, what: &str, rows: &[Row]) -> String {
        let head = self.columns.iter().map(|column| {
            let arrow = if column.more_is_better { "↑" } else { "↓" };
            if column.unit.is_empty() {
                format!("{} {arrow}", column.name)
            } else {
                format!("{}, {} {arrow}", column.name, column.unit)
            }
        });
        let mut text = format!("| {what} | count | {} |\n", head.collect::<Vec<_>>().join(" | "));
        let _ = writeln!(text, "|---|---|{}", "---|".repeat(self.columns.len()));
        for row in rows {
            let values: Vec<String> = row.values.iter().map(|value| number(*value)).collect();
            let _ = writeln!(text, "| {} | {} | {} |", row.name.replace('|', "\\|"), row.count, values.join(" | "));
        }
        text
    }

    /// Writes `FILE.json`, and beside it `FILE.md` and the plots as `FILE-NAME.svg`; returns their paths.
    ///
    /// # Errors
    /// [`EvalError::Write`].
    pub fn write(&self, json: &Path) -> Result<Vec<PathBuf>, EvalError> {
        let text = format!("{:#}\n", self.to_json());
        let mut written = vec![put(json.to_owned(), &text)?, put(json.with_extension("md"), &self.to_markdown())?];
        let stem = json.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        for plot in &self.plots {
            written.push(put(json.with_file_name(format!("{stem}-{}.svg", plot.name)), &plot::svg(plot))?);
        }
        Ok(written)
    }
}

fn put(path: PathBuf, text: &str) -> Result<PathBuf, EvalError> {
    let write = || {
        let mut file = AtomicFile::create(&path)?;
        file.write_all(text.as_bytes())?;
        file.commit()
    };
    write().map_err(|source| EvalError::Write { path: path.clone(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> Report {
        Report {
            kind: "depth",
            protocol: Protocol { data_set: "KITTI".into(), ..Protocol::default() },
            columns: vec![Column::less("abs_rel", ""), Column::less("rmse", "m"), Column::more("delta_1.25")],
            rows: vec![Row { name: "scale".into(), count: 1, values: vec![0.071_23, 3.657, f64::NAN] }],
            sequences: vec![Row { name: "a|b".into(), count: 16, values: vec![0.071_23, 3.657, f64::NAN] }],
            skipped: vec![Skipped { name: "b".into(), reason: "no prediction".into(), counts_as_zero: false }],
            notes: vec!["a note".into()],
            plots: vec![],
        }
    }

    #[test]
    fn json_has_all_and_null_for_nan() {
        let json = report().to_json();
        assert_eq!(json["means"][0]["values"]["abs_rel"], 0.071_23);
        assert!(json["means"][0]["values"]["delta_1.25"].is_null());
        assert_eq!((&json["skipped"][0]["name"], &json["evaluated"]), (&json!("b"), &json!(1)));
    }

    #[test]
    fn markdown_names_what_was_skipped() {
        let text = report().to_markdown();
        assert!(text.contains("| scale | 1 | 0.07123 | 3.657 | – |"), "{text}");
        assert!(
            text.contains("| a\\|b | 16 |") && text.contains("- b: no prediction") && text.contains("rmse, m ↓"),
            "{text}"
        );
    }

    #[test]
    fn files_lie_side_by_side() {
        let dir = tempfile::tempdir().unwrap();
        let written = report().write(&dir.path().join("deep/r.json")).unwrap();
        assert_eq!(written, [dir.path().join("deep/r.json"), dir.path().join("deep/r.md")]);
        let back: Value = serde_json::from_str(&std::fs::read_to_string(&written[0]).unwrap()).unwrap();
        assert_eq!(back["kind"], "depth");
    }
}
