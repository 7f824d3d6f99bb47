//! The networks: configurations, manifests, and the graphs they record, the latter against recorded goldens too, by the
//! interpreter of graphs that knows no device (`omnix_tests::interpret`). Configurations and tensor lists of the goldens are in `tests/data/model`; the
//! goldens themselves are used when `../shared` is there. Also what plans of them cost, counted (`work`).

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

mod ablations;
mod config;
mod fixture;
mod goldens;
mod graphs;
mod manifest;
mod plans;
mod work;
