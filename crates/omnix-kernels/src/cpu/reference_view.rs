//! Oracle of `reference_view`.

use crate::reference_view::Strategy;

/// One score a view, the least wins: for the strategies that compute one.
#[must_use]
pub fn reference_view_scores(balanced: bool, (s, c): (usize, usize), x: &[f32]) -> Vec<f64> {
    let token = |view: usize| x[view * c..][..c].iter().map(|&v| f64::from(v));
    let length: Vec<f64> = (0..s).map(|view| token(view).map(|v| v * v).sum::<f64>().sqrt()).collect();
    let sim = |a: usize, b: usize| match a == b {
        true => 0.0,
        false => token(a).zip(token(b)).map(|(v, w)| v * w).sum::<f64>() / (length[a] * length[b]),
    };
    if !balanced {
        let range = |view: usize| {
            let all = (0..s).map(|t| sim(view, t));
            all.clone().fold(f64::INFINITY, f64::min) - all.fold(f64::NEG_INFINITY, f64::max)
        };
        return (0..s).map(range).collect();
    }
    let variance = |view: usize| {
        let mean = token(view).sum::<f64>() / length[view] / c as f64;
        token(view).map(|v| (v / length[view] - mean).powi(2)).sum::<f64>() / (c.max(2) - 1) as f64
    };
    let metrics: [Vec<f64>; 3] = [
        (0..s).map(|view| (0..s).map(|t| sim(view, t)).sum::<f64>() / (s.max(2) - 1) as f64).collect(),
        length.clone(),
        (0..s).map(variance).collect(),
    ];
    let mut scores = vec![0.0; s];
    for metric in &metrics {
        let low = metric.iter().copied().fold(f64::INFINITY, f64::min);
        let high = metric.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for (score, v) in scores.iter_mut().zip(metric) {
            *score += ((v - low) / (high - low + 1e-8) - 0.5).abs();
        }
    }
    scores
}

/// The reference view: the least score, the first on ties.
#[must_use]
pub fn reference_view(strategy: Strategy, (s, c): (usize, usize), x: &[f32]) -> usize {
    let balanced = match strategy {
        Strategy::First => return 0,
        Strategy::Middle => return s / 2,
        Strategy::Forced(view) => return view as usize,
        Strategy::SaddleBalanced => true,
        Strategy::SaddleSimRange => false,
    };
    let scores = reference_view_scores(balanced, (s, c), x);
    (1..s).fold(0, |best, view| if scores[view] < scores[best] { view } else { best })
}
