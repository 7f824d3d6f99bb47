//! Any-view reconstruction on any GPU: images of a scene in; depth, confidence, cameras and rays out.
//!
//! The engine runs on a `wgpu::Device` that the host lends it, knows its memory before it runs, and hands out
//! results image by image, on the device or on the host.
//!
//! ```no_run
//! use omnix::{Engine, Event, Request, RunPlan, Session, Weights};
//!
//! # fn main() -> Result<(), omnix::OmnixError> {
//! let weights = Weights::find("nano")?; // or Weights::open(folder)
//! let engine = Engine::open(None)?; // or Engine::new(&device, &queue)
//! let request = Request::new(2, 84, 140);
//! let plan = RunPlan::new(&weights, &request, engine.caps())?;
//! println!("needs {} MiB", plan.peak_bytes() >> 20);
//! let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet())?;
//! session.set_image(0, &vec![0.0; 3 * 84 * 140])?;
//! session.set_image(1, &vec![0.0; 3 * 84 * 140])?;
//! session.run(&mut |event| {
//!     if let Event::Frame(frame) = event {
//!         println!("image {}: {} depths", frame.index, frame.depth.len());
//!     }
//!     Ok(())
//! })?;
//! # Ok(())
//! # }
//! ```
//!
//! Every call that waits for the device exists twice: as above it blocks its thread, and with the ending `_async` it is a future, for
//! web pages, which cannot block (`wasm32-unknown-unknown`, without the feature `io`).

#[cfg(all(feature = "bench", not(target_arch = "wasm32")))]
pub mod bench;
#[cfg(not(target_arch = "wasm32"))]
mod blocking;
mod engine;
mod error;
mod event;
mod field;
mod masks;
mod plan;
pub mod render;
mod request;
mod session;
mod weights;
#[cfg(feature = "io")]
pub mod windows;

pub use engine::{DeviceInfo, Engine};
pub use error::OmnixError;
#[cfg(feature = "io")]
pub use event::WindowBegun;
pub use event::{Event, FrameGeometry, FrameMotion, Listener, Phase, Progress, ResidentGeometry, quiet};
pub use field::{
    About, Chunk, Field, FieldImage, FieldShape, PathPiece, Paths, PixelValues, Pixels, Query, ResidentPaths,
};
#[cfg(feature = "io")]
pub use field::{FieldPrecision, ImageMotion};
pub use masks::{Masks, PixelMark};
pub use omnix_geometry::{AlignTo, Camera};
pub use omnix_kernels::{Caps, Tier, WeightType};
pub use omnix_model::backbone::ReferenceChoice;
pub use plan::{FieldSummary, MotionPlan, PlanSummary, RunPlan, StageSummary};
pub use request::{FieldPlace, KnownDistance, Request};
pub use session::Session;
pub use weights::Weights;

pub use omnix_geometry as geometry;
pub use omnix_graph as graph;
/// File inputs and outputs: frames of videos and folders, preprocessing, export formats.
#[cfg(feature = "io")]
pub use omnix_io as io;
pub use omnix_kernels as kernels;
pub use omnix_model as model;
pub use omnix_tensors as tensors;
pub use omnix_weights as checkpoint;
pub use wgpu;
