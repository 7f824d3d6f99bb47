//! Long sums over rows, cut so that a device has enough to do at once: into sections, which workgroups sum side by side, of whole
//! parts, which are summed one after the other. Where the cuts lie follows from shapes alone, so that binding limits change no bit:
//! a window ends where a part ends, and the next one goes on from the sums so far.

use crate::dispatch::round_up;

/// How the rows of a sum are cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sections {
    /// All rows.
    pub rows: u64,
    /// Rows of a section; the last one has what is left.
    pub each: u64,
}

/// Rows that one dispatch sums: some whole sections, or a piece of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub row0: u64,
    pub rows: u64,
    /// The first section and how many.
    pub section: u64,
    pub sections: u64,
    /// Whether earlier rows of the section are summed already.
    pub go_on: bool,
}

impl Sections {
    /// About `wanted` sections of whole parts of `part` rows, none of them shorter than `least` rows but the last.
    pub(crate) fn new(rows: u64, part: u64, wanted: u64, least: u64) -> Self {
        let count = wanted.min(rows.div_ceil(least)).max(1);
        Self { rows, each: round_up(rows.div_ceil(count).max(1), part) }
    }

    /// Number of sections.
    pub(crate) const fn count(&self) -> u64 {
        self.rows.div_ceil(self.each)
    }

    /// Runs of at most `fit` rows, a multiple of a part, that cover all rows in order; at most `most` sections in one.
    pub(crate) fn runs(&self, fit: u64, most: u64) -> Vec<Run> {
        let together = (fit / self.each).min(most).max(1);
        let mut runs = Vec::new();
        for section in (0..self.count()).step_by(together as usize) {
            let sections = together.min(self.count() - section);
            let (start, end) = (section * self.each, ((section + sections) * self.each).min(self.rows));
            for row0 in (start..end).step_by(fit.min(end - start).max(1) as usize) {
                runs.push(Run { row0, rows: fit.min(end - row0), section, sections, go_on: row0 > start });
            }
        }
        runs
    }
}

#[cfg(test)]
mod tests {
    use super::Sections;

    #[test]
    fn runs_cover_all_rows_and_whole_sections_where_they_can() {
        for (rows, wanted) in [(1, 1), (63, 9), (64, 2), (1000, 3), (5184, 7), (5184, 1)] {
            let sections = Sections::new(rows, 64, wanted, 64);
            assert!(sections.count() <= wanted && sections.each.is_multiple_of(64), "{sections:?}");
            for fit in [64, 128, 640, 6400] {
                let runs = sections.runs(fit, 4);
                let mut next = 0;
                for run in runs {
                    assert_eq!(run.row0, next, "{sections:?} {fit}");
                    assert!(run.rows <= fit && run.rows > 0 && run.sections <= 4);
                    assert_eq!(run.go_on, run.row0 % sections.each != 0);
                    assert!(
                        run.sections == 1 || run.row0 % sections.each == 0 && run.row0 / sections.each == run.section
                    );
                    next += run.rows;
                }
                assert_eq!(next, rows);
            }
        }
    }
}
