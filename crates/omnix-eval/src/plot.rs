//! Plots as SVG text: lines over frames, and bars of sequences, the worst first.
//!
//! A picture of 860 x 420 units without scripts and fonts of its own. All lines are drawn thin; the worst five by their mean are coloured
//! and named.

use std::fmt::Write as _;

use crate::digits::number;
use crate::stats::mean_of_numbers;

/// What is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// The end of its file's name.
    pub name: &'static str,
    /// What stands above it.
    pub title: String,
    /// What the horizontal axis says; empty for bars.
    pub x: &'static str,
    /// What the vertical axis says.
    pub y: &'static str,
    /// Whether more is better: the worst are then the least.
    pub more_is_better: bool,
    /// The lines, or one bar for each series of one value.
    pub series: Vec<(String, Vec<f64>)>,
    /// Lines or bars.
    pub form: Form,
}

/// How it is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A line for each series, its values at 0, 1, 2...
    Lines,
    /// A bar for the mean of each series, the worst at the top.
    Bars,
}

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 420.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 230.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 50.0;
const COLOURS: [&str; 5] = ["#c0392b", "#2471a3", "#1e8449", "#7d3c98", "#b9770e"];
/// Bars that are drawn; of the others their number is said.
const BARS: usize = 40;

/// The plot as SVG.
#[must_use]
pub fn svg(plot: &Plot) -> String {
    let mut order: Vec<usize> = (0..plot.series.len()).collect();
    let mean = |k: usize| mean_of_numbers(plot.series[k].1.iter().copied()).0;
    // NaN last.
    let badness = |k: usize| {
        if mean(k).is_nan() {
            f64::NEG_INFINITY
        } else if plot.more_is_better {
            -mean(k)
        } else {
            mean(k)
        }
    };
    order.sort_by(|&a, &b| badness(b).total_cmp(&badness(a)).then(a.cmp(&b)));
    match plot.form {
        Form::Lines => lines(plot, &order),
        Form::Bars => bars(plot, &order, &mean),
    }
}

fn begin(title: &str, height: f64) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n<text x=\"{LEFT}\" y=\"22\" font-size=\"15\">{}</text>\n",
        escaped(title)
    )
}

fn lines(plot: &Plot, order: &[usize]) -> String {
    let values = || plot.series.iter().flat_map(|(_, values)| values).copied().filter(|v| v.is_finite());
    let (low, high, step) = ticks(values().fold(0.0, f64::min), values().fold(0.0, f64::max));
    let length = plot.series.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    let x = |frame: usize| LEFT + (right - LEFT) * frame as f64 / length.saturating_sub(1).max(1) as f64;
    let y = |value: f64| bottom - (bottom - TOP) * (value - low) / (high - low);
    let mut out = begin(&plot.title, HEIGHT);
    // Writing to a string does not fail.
    for k in 0..=((high - low) / step).round() as usize {
        let value = low + k as f64 * step;
        let (at, label) = (y(value), number(value));
        let _ = writeln!(out, "<line x1=\"{LEFT}\" x2=\"{right}\" y1=\"{at:.1}\" y2=\"{at:.1}\" stroke=\"#dddddd\"/>");
        let _ = writeln!(out, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>", LEFT - 6.0, at + 4.0);
    }
    let every = length.div_ceil(10).max(1);
    for frame in (0..length).step_by(every) {
        let _ =
            writeln!(out, "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{frame}</text>", x(frame), bottom + 16.0);
    }
    // The worst on top of the others.
    for (rank, &k) in order.iter().enumerate().rev() {
        let (name, values) = &plot.series[k];
        let (colour, width) = COLOURS.get(rank).map_or(("#bbbbbb", 0.8), |colour| (*colour, 1.8));
        // A gap where there is no number.
        for run in runs(values) {
            let points: Vec<String> =
                run.clone().map(|frame| format!("{:.1},{:.1}", x(frame), y(values[frame]))).collect();
            let dot = if run.len() == 1 { " stroke-linecap=\"round\"" } else { "" };
            let points = if run.len() == 1 { format!("{0} {0}", points[0]) } else { points.join(" ") };
            let _ = writeln!(
                out,
                "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"{dot}/>"
            );
        }
        if rank < COLOURS.len() {
            let at = TOP + 16.0 + 18.0 * rank as f64;
            let _ = writeln!(
                out,
                "<text x=\"{}\" y=\"{at}\" fill=\"{colour}\">{}</text>",
                right + 12.0,
                escaped(&short(name))
            );
        }
    }
    let more = order.len().saturating_sub(COLOURS.len());
    if more > 0 {
        let at = TOP + 16.0 + 18.0 * COLOURS.len() as f64;
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{at}\" fill=\"#888888\">and {more} more, better ones</text>",
            right + 12.0
        );
    }
    let middle = (LEFT + right) / 2.0;
    let _ =
        writeln!(out, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">{}</text>", HEIGHT - 12.0, escaped(plot.x));
    let centre = (TOP + bottom) / 2.0;
    let _ = writeln!(
        out,
        "<text transform=\"translate(16 {centre}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        escaped(plot.y)
    );
    out + "</svg>\n"
}

fn bars(plot: &Plot, order: &[usize], mean: &dyn Fn(usize) -> f64) -> String {
    const ROW: f64 = 18.0;
    const NAMES: f64 = 250.0;
    let shown = &order[..order.len().min(BARS)];
    let height = TOP + ROW * (shown.len() as f64 + 1.0) + 24.0;
    let most = shown.iter().map(|&k| mean(k)).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let mut out = begin(&plot.title, height);
    for (row, &k) in shown.iter().enumerate() {
        let (name, value) = (escaped(&short(&plot.series[k].0)), mean(k));
        let at = TOP + ROW * row as f64;
        let wide = if value.is_finite() && most > 0.0 { (WIDTH - NAMES - 90.0) * value.max(0.0) / most } else { 0.0 };
        let _ = writeln!(out, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{name}</text>", NAMES - 8.0, at + 12.0);
        let _ = writeln!(
            out,
            "<rect x=\"{NAMES}\" y=\"{:.1}\" width=\"{wide:.1}\" height=\"13\" fill=\"{}\"/>",
            at + 1.0,
            COLOURS[1]
        );
        let _ = writeln!(out, "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>", NAMES + wide + 6.0, at + 12.0, number(value));
    }
    let more = order.len() - shown.len();
    let rest = if more > 0 { format!("; {more} more, better ones are not shown") } else { String::new() };
    let _ = writeln!(
        out,
        "<text x=\"{NAMES}\" y=\"{:.1}\" fill=\"#666666\">{}{rest}</text>",
        height - 14.0,
        escaped(plot.y)
    );
    out + "</svg>\n"
}

/// Stretches of finite values.
fn runs(values: &[f64]) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for (k, _) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        match runs.last_mut() {
            Some(run) if run.end == k => run.end += 1,
            _ => runs.push(k..k + 1),
        }
    }
    runs
}

/// Round ends and step of an axis that holds both values.
fn ticks(low: f64, high: f64) -> (f64, f64, f64) {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return (low, low + 1.0, 0.25);
    }
    let raw = span / 5.0;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|m| m * power).into_iter().find(|&s| s >= raw).unwrap_or(raw);
    ((low / step).floor() * step, (high / step).ceil() * step, step)
}

/// A name that fits beside a plot.
fn short(name: &str) -> String {
    const MOST: usize = 34;
    let count = name.chars().count();
    if count <= MOST {
        name.to_owned()
    } else {
        format!("…{}", name.chars().skip(count - MOST + 1).collect::<String>())
    }
}

fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
    text.chars().filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(form: Form, series: &[(&str, &[f64])]) -> Plot {
        let series = series.iter().map(|(name, values)| ((*name).to_owned(), values.to_vec())).collect();
        Plot { name: "x", title: "a < b".into(), x: "frame", y: "error, m", more_is_better: false, series, form }
    }

    #[test]
    fn the_worst_are_named_and_text_is_escaped() {
        let names: Vec<String> = (0..7).map(|k| format!("s{k}")).collect();
        let values: Vec<[f64; 2]> = (0..7).map(|k| [f64::from(k), f64::from(k)]).collect();
        let series: Vec<(&str, &[f64])> = names.iter().zip(&values).map(|(n, v)| (n.as_str(), v.as_slice())).collect();
        let text = svg(&plot(Form::Lines, &series));
        assert!(
            text.contains(">s6<") && text.contains(">s2<") && !text.contains(">s1<") && text.contains("and 2 more"),
            "{text}"
        );
        assert!(text.contains("a &lt; b"));
    }

    #[test]
    fn bars_begin_with_the_worst() {
        let text = svg(&plot(Form::Bars, &[("good", &[0.1]), ("bad", &[0.9]), ("none", &[f64::NAN])]));
        let at = |name: &str| text.find(&format!(">{name}<")).unwrap();
        assert!(at("bad") < at("good") && at("good") < at("none"), "{text}");
    }

    #[test]
    fn nothing_and_nan_have_a_plot() {
        for form in [Form::Lines, Form::Bars] {
            for series in [&[][..], &[("a", &[][..])], &[("a", &[f64::NAN, 1.0, f64::INFINITY][..])]] {
                let text = svg(&plot(form, series));
                assert!(text.ends_with("</svg>\n") && !text.contains("NaN") && !text.contains("inf"), "{text}");
            }
        }
        assert_eq!(runs(&[1.0, 2.0, f64::NAN, 3.0]), [0..2, 3..4]);
    }

    #[test]
    fn axes_are_round() {
        assert_eq!(ticks(0.0, 0.9), (0.0, 1.0, 0.2));
        assert_eq!(ticks(0.0, 0.0), (0.0, 1.0, 0.25));
    }
}
