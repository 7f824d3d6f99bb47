//! A page with the curves of a run: one HTML file that a browser shows without a network. It has no script; curves are SVG.

use std::fmt::Write as _;

use super::curve::Curve;

/// A diagram: curves by label over one pair of axes.
pub(super) struct Diagram<'a> {
    /// What it shows.
    pub(super) title: &'a str,
    /// The curves, each with its label.
    pub(super) curves: Vec<(&'a str, &'a Curve)>,
}

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 220.0;
/// Margins: left for numbers, right, top, bottom for steps.
const LEFT: f64 = 58.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 24.0;
const COLOURS: [&str; 6] = ["#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#57606a"];
/// From this ratio of the largest to the smallest number on, an axis is logarithmic.
const LOGARITHMIC: f64 = 20.0;

const HEAD: &str = r#"<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<style>
body{font:14px/1.45 system-ui,sans-serif;margin:24px;color:#1f2328;background:#fff}
h1{font-size:20px;margin:0 0 4px} table{border-collapse:collapse;margin:8px 0} td{padding:1px 12px 1px 0}
main{display:grid;grid-template-columns:repeat(auto-fill,minmax(440px,1fr));gap:16px}
figure{margin:0;border:1px solid #d0d7de;border-radius:6px;padding:10px} figcaption{font-weight:600}
svg{width:100%;height:auto} text{font-size:11px;fill:#57606a} pre{overflow:auto;background:#f6f8fa;padding:10px}
@media (prefers-color-scheme:dark){body{color:#e6edf3;background:#0d1117} pre{background:#161b22} figure{border-color:#30363d}}
</style>
"#;

/// The page: a title, facts by name, diagrams, and the settings as a text.
#[must_use]
pub(super) fn page(title: &str, facts: &[(&str, String)], diagrams: &[Diagram<'_>], settings: &str) -> String {
    let mut out = String::from(HEAD);
    let title = escaped(title);
    let _ = write!(out, "<title>{title}</title></head><body>\n<h1>{title}</h1>\n<table>\n");
    for (name, value) in facts {
        let _ = writeln!(out, "<tr><td>{}</td><td>{}</td></tr>", escaped(name), escaped(value));
    }
    out.push_str("</table>\n<main>\n");
    for diagram in diagrams.iter().filter(|diagram| diagram.curves.iter().any(|(_, curve)| curve.last().is_some())) {
        figure(&mut out, diagram);
    }
    let _ = write!(out, "</main>\n<h2>Settings</h2>\n<pre>{}</pre>\n</body></html>\n", escaped(settings));
    out
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// An axis: the range of numbers, and whether distances are those of their logarithms.
struct Axis {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, may_be_logarithmic: bool) -> Self {
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let logarithmic = may_be_logarithmic && low > 0.0 && high / low > LOGARITHMIC;
        // One value lies in the middle.
        let spread = if high > low { 0.0 } else { (low.abs() * 0.1).max(1e-9) };
        Self { low: low - spread, high: high + spread, logarithmic }
    }

    /// 0 at the low end, 1 at the high one.
    fn place(&self, value: f64) -> f64 {
        let scale = |v: f64| if self.logarithmic { v.ln() } else { v };
        (scale(value) - scale(self.low)) / (scale(self.high) - scale(self.low))
    }

    /// Round numbers along the axis.
    fn ticks(&self) -> Vec<f64> {
        if self.logarithmic {
            let (from, to) = (self.low.log10().ceil() as i32, self.high.log10().floor() as i32);
            let stride = ((to - from).max(0) / 5 + 1) as usize;
            let tens: Vec<f64> = (from..=to).step_by(stride).map(|e| 10f64.powi(e)).collect();
            return if tens.len() > 1 { tens } else { vec![self.low, (self.low * self.high).sqrt(), self.high] };
        }
        let rough = (self.high - self.low) / 4.0;
        let ten = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * ten).into_iter().find(|step| *step >= rough).unwrap_or(rough);
        let first = (self.low / step).ceil() as i64;
        (0..12).map(|i| (first + i) as f64 * step).take_while(|v| *v <= self.high).collect()
    }
}

/// A number with four digits that count.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    let decimals = (3.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn figure(out: &mut String, diagram: &Diagram<'_>) {
    let all = || diagram.curves.iter().flat_map(|(_, curve)| curve.points());
    let (steps, values) = (Axis::new(all().map(|p| p.0), false), Axis::new(all().map(|p| p.1), true));
    let x = |step: f64| LEFT + steps.place(step) * (WIDTH - LEFT - RIGHT);
    let y = |value: f64| HEIGHT - BOTTOM - values.place(value) * (HEIGHT - TOP - BOTTOM);
    let _ = write!(out, "<figure><figcaption>{}</figcaption>", escaped(diagram.title));
    let _ = writeln!(out, r#"<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{}">"#, escaped(diagram.title));
    for tick in values.ticks() {
        let (y, label) = (y(tick), number(tick));
        let _ = write!(out, r##"<path d="M{LEFT} {y:.1}H{}" stroke="#d0d7de" stroke-width=".5"/>"##, WIDTH - RIGHT);
        let _ = writeln!(out, r#"<text x="{}" y="{:.1}" text-anchor="end">{label}</text>"#, LEFT - 6.0, y + 4.0);
    }
    for tick in steps.ticks() {
        let _ = writeln!(
            out,
            r#"<text x="{:.1}" y="{}" text-anchor="middle">{}</text>"#,
            x(tick),
            HEIGHT - 6.0,
            number(tick)
        );
    }
    for ((_, curve), colour) in diagram.curves.iter().zip(COLOURS.iter().cycle()) {
        let points: Vec<String> = curve.points().map(|(s, v)| format!("{:.1},{:.1}", x(s), y(v))).collect();
        match points.as_slice() {
            [] => {}
            [point] => {
                let (x, y) = point.split_once(',').unwrap_or_default();
                let _ = writeln!(out, r#"<circle cx="{x}" cy="{y}" r="2.5" fill="{colour}"/>"#);
            }
            points => {
                let points = points.join(" ");
                let style = r#"fill="none" stroke-width="1.4" stroke-linejoin="round""#;
                let _ = writeln!(out, r#"<polyline points="{points}" stroke="{colour}" {style}/>"#);
            }
        }
    }
    out.push_str("</svg><div>");
    for ((label, curve), colour) in diagram.curves.iter().zip(COLOURS.iter().cycle()) {
        let last = curve.last().map_or_else(String::new, |(_, value)| number(value));
        let _ = write!(out, r#"<span style="color:{colour}">●</span> {} {last} &nbsp; "#, escaped(label));
    }
    out.push_str("</div></figure>\n");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_its_curves_and_asks_for_nothing() {
        let (mut falling, mut one, none) = (Curve::default(), Curve::default(), Curve::default());
        (1..=100).for_each(|step| falling.push(step, 100.0 / step as f64));
        one.push(5, 2.0);
        let diagrams = [
            Diagram { title: "loss <total>", curves: vec![("training", &falling), ("validation", &one)] },
            Diagram { title: "nothing", curves: vec![("empty", &none)] },
        ];
        let page = page("run & more", &[("step", "100 of 200".to_owned())], &diagrams, "a = \"<b>\"");
        assert!(page.contains("run &amp; more") && page.contains("loss &lt;total&gt;") && page.contains("&lt;b&gt;"));
        assert_eq!((page.matches("<svg").count(), page.matches("<polyline").count()), (1, 1));
        assert!(!page.contains("nothing") && !page.contains("http") && !page.contains("NaN") && !page.contains("inf"));
        // Logarithmic: ten times less is as far as ten times less again.
        let axis = Axis::new([100.0, 1.0].into_iter(), true);
        assert!(axis.logarithmic && (axis.place(10.0) - 0.5).abs() < 1e-12);
        assert_eq!(axis.ticks(), [1.0, 10.0, 100.0]);
    }

    #[test]
    fn axes_hold_whatever_comes() {
        for values in [vec![0.0], vec![-3.0, 5.0], vec![1e-30, 1e30], vec![7.0, 7.0], vec![-1e-12, 0.0]] {
            let axis = Axis::new(values.iter().copied(), true);
            assert!(values.iter().all(|v| (0.0..=1.0).contains(&axis.place(*v))), "{values:?}");
            assert!(axis.ticks().len() <= 12 && axis.ticks().iter().all(|tick| tick.is_finite()));
        }
    }

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 1.0, 0.25, 1234.0, 12.345_6, 1e-5, 2.5e7, -0.5].map(number);
        assert_eq!(shown, ["0", "1", "0.25", "1234", "12.35", "1.00e-5", "2.50e7", "-0.5"]);
    }
}
