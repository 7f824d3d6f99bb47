//! A whole evaluation from two folders, one of predictions and one of truth, to a [`Report`](crate::table::Report).
//!
//! A sequence that cannot be scored is never dropped silently: it stands in the report with its reason, and where a protocol counts it as
//! zero, it does. Only when no sequence at all has a result an evaluation is an error.

pub mod depth;
pub mod pose;
pub(crate) mod sequences;
pub mod tapvid3d;
pub mod trajectories;
