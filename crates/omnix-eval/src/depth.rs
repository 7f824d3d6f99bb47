//! Video depth by the formulas that MonST3R, CUT3R and pi3 share (`eval.md` section 5).
//!
//! A sequence's pixels with known depth (`0 < g`, and `g < max_depth` where a protocol has one) are taken together; the prediction is
//! aligned once ([`Alignment`]), clipped from above, and scored: Abs Rel = mean |p - g|/g, Sq Rel = mean (p - g)^2/g, RMSE, Log RMSE and
//! delta_k = share with max(p/g, g/p) < 1.25^k, p being at least 1e-5 in the last two. A data set's mean weighs sequences by pixels.

mod metrics;
mod pixels;
mod resize;
mod scale;

pub use metrics::{DepthMetrics, DepthScore, mean, score};
pub use pixels::{Pixels, Range};
pub use resize::{Part, resize_cubic, resize_part};
pub use scale::{Alignment, Fit};
