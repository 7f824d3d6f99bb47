//! A report for people: lines of text, and a page with contact sheets.

use std::fmt::Write as _;
use std::path::Path;

use image::ExtendedColorType;

use super::SceneReport;
use crate::DataError;
use crate::sets::shared::{png, put};
use omnix_io::Picture;

/// A report as lines: what there is, what was measured, what is wrong.
#[must_use]
pub fn lines(report: &SceneReport) -> String {
    let counts = &report.counts;
    let mut text = format!("{} ({})\n", report.path, report.set);
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let mut line = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {name:<11} {value}");
    };
    line(
        "images",
        format!(
            "{} of {} in {} video(s), {} x {} pixels",
            counts.images, counts.all_images, counts.videos, counts.size[0], counts.size[1]
        ),
    );
    match (counts.depth_known, counts.depth_range) {
        (Some(known), Some([near, far])) => line("depth", format!("{} known, {near:.3} to {far:.3}", percent(known))),
        _ => line("depth", "none".to_owned()),
    }
    line("moving", counts.moving.map_or("no masks".to_owned(), percent));
    let paths = match (counts.tracks, counts.positions_known) {
        (Some(count), Some(known)) => format!("{count} tracks, {} of their positions known", percent(known)),
        (None, Some(known)) => format!("dense, {} of the positions known", percent(known)),
        _ => "none".to_owned(),
    };
    line("paths", paths);
    match &report.warp {
        None => line("warp", "no two views to compare".to_owned()),
        Some(warp) => {
            let told = if warp.told { "" } else { ": the cameras hardly move, which tells nothing about them" };
            line(
                "warp",
                format!(
                    "median {:.1e}, 95 % below {:.1e}, {} hidden, {} in front, overlap {}{told}",
                    warp.median,
                    warp.percentile_95,
                    percent(warp.hidden),
                    percent(warp.in_front),
                    percent(warp.overlap)
                ),
            );
        }
    }
    if let Some(tracks) = &report.tracks {
        let [right, down] = tracks.offset;
        line(
            "places",
            format!(
                "{} compared, median {:.3} pixels, 95 % below {:.3}, largest {:.3}, mean offset {right:+.2} right, {down:+.2} down",
                tracks.compared, tracks.median, tracks.percentile_95, tracks.most
            ),
        );
    }
    if let Some(seen) = &report.visibility {
        line("visibility", format!("{} of {} flags contradict depth", seen.contradictions, seen.compared));
    }
    for problem in &report.problems {
        line("problem", format!("{}: {}", problem.kind, problem.text));
    }
    text
}

/// Writes a contact sheet as PNG.
///
/// # Errors
/// A failure of writing.
pub fn write_sheet(sheet: &Picture, path: &Path) -> Result<(), DataError> {
    put(path, &png(&sheet.data, [sheet.width, sheet.height], ExtendedColorType::Rgb8, path)?)
}

/// Writes a page that shows reports, each with the sheet of this name (relative to the page), if there is one.
///
/// # Errors
/// A failure of writing.
pub fn write_page(reports: &[(SceneReport, Option<String>)], path: &Path) -> Result<(), DataError> {
    let wrong = reports.iter().filter(|(report, _)| !report.problems.is_empty()).count();
    let mut page = String::from(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>omnix data check</title>\n\
         <style>body{font:14px sans-serif;margin:2em;background:#111;color:#ddd}img{max-width:100%}pre{white-space:pre-wrap}\
         .bad{border-left:4px solid #d43;padding-left:1em}.good{border-left:4px solid #3a5;padding-left:1em}</style>\n",
    );
    let _ = writeln!(page, "<h1>{} scene(s), {wrong} with problems</h1>", reports.len());
    for (report, sheet) in reports {
        let class = if report.problems.is_empty() { "good" } else { "bad" };
        let _ = writeln!(page, "<section class=\"{class}\"><pre>{}</pre>", escaped(&lines(report)));
        if let Some(sheet) = sheet {
            let name = escaped(sheet);
            let _ =
                writeln!(page, "<a href=\"{name}\"><img src=\"{name}\" alt=\"contact sheet\" loading=\"lazy\"></a>");
        }
        page.push_str("</section>\n");
    }
    page.push_str("</html>\n");
    put(path, page.as_bytes())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{Problem, check};
    use crate::made;
    use crate::sheet::sheet;

    #[test]
    fn lines_and_page_say_what_was_found() {
        let dir = tempfile::tempdir().unwrap();
        let sample = made::video([28, 14], 3);
        let mut report = check(&sample, Path::new("a <scene>"));
        let text = lines(&report);
        assert!(text.contains("28 x 14 pixels") && text.contains("flags contradict depth"), "{text}");
        assert!(!text.contains("problem"), "{text}");
        report.problems.push(Problem { kind: "warp", text: "it is \"off\"".to_owned() });
        assert!(lines(&report).contains("problem     warp: it is"), "{}", lines(&report));
        write_sheet(&sheet(&sample), &dir.path().join("sheets/000.png")).unwrap();
        let page = dir.path().join("index.html");
        write_page(&[(report, Some("sheets/000.png".to_owned()))], &page).unwrap();
        let page = std::fs::read_to_string(page).unwrap();
        assert!(
            page.contains("a &lt;scene&gt;") && page.contains("src=\"sheets/000.png\"") && page.contains("&quot;off")
        );
        assert!(image::open(dir.path().join("sheets/000.png")).is_ok());
    }
}
