//! Points on the device, and pictures of them.

use std::ops::ControlFlow;

use omnix_geometry::Camera;
use omnix_graph::ops::Splat;
use omnix_graph::{Bindings, Executable, Graph, Plan, PlanOptions, WeightStore};
use omnix_kernels::splat::{VIEW_WORDS, view};
use omnix_kernels::{BufferSlice, Caps};

use crate::engine::Engine;
use crate::error::OmnixError;

/// Largest radius of a disc in pixels: what is nearer to the camera has holes between its points.
const LARGEST: u32 = 32;

/// A renderer before there is a device for it: how many points, how large a picture, and the bytes that takes.
#[derive(Debug)]
pub struct RenderPlan {
    plan: Plan,
    points: usize,
    size: [u32; 2],
}

impl RenderPlan {
    /// For at most this number of points, and pictures of `[width, height]`.
    ///
    /// # Errors
    /// [`OmnixError::Request`] for a picture without pixels or with more than 16384 columns or rows; a tensor above the limits of the
    /// device.
    pub fn new(points: usize, size: [u32; 2], caps: &Caps) -> Result<Self, OmnixError> {
        let largest = omnix_kernels::splat::Splat::LARGEST_SIDE;
        if size.iter().any(|side| !(1..=largest).contains(side)) {
            let [width, height] = size;
            let reason = format!("a picture of {width}x{height} pixels: each side has 1 to {largest}");
            return Err(OmnixError::Request { reason });
        }
        let n = points.max(1);
        let mut graph = Graph::new();
        let inputs = [("points", vec![n, 3]), ("sizes", vec![n]), ("colours", vec![n]), ("view", vec![VIEW_WORDS])];
        let [points, sizes, colours, view] = inputs.map(|(name, shape)| graph.input(name, shape.as_slice()));
        let [width, height] = size.map(|side| side as usize);
        let picture = graph.splat(&Splat { points, sizes, colours, view, size: [height, width], largest: LARGEST })?;
        graph.output(picture, "picture");
        Ok(Self { plan: Plan::new(&graph, caps, &PlanOptions::default())?, points: n, size })
    }

    /// Bytes that the renderer takes at most, with the staging that a picture is read back through.
    #[must_use]
    pub fn peak_bytes(&self) -> u64 {
        let [width, height] = self.size.map(u64::from);
        self.plan.working_bytes() + width * height * 16
    }
}

/// Points on a device, of which it makes pictures. Places that were never written, or have a position that is not finite, are empty.
#[derive(Debug)]
pub struct Renderer {
    exec: Executable,
    points: usize,
    size: [u32; 2],
}

/// Who looks, and what is behind the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shot {
    /// Pose and intrinsics, in pixels of the picture with the centre of the pixel of column x at x + 0.5.
    pub camera: Camera,
    /// Depth below which nothing is drawn.
    pub near: f32,
    /// How far behind the nearest disc, as a share of its depth, another belongs to the same surface and is mixed with it.
    pub layer: f32,
    /// Red, green, blue and cover of the background, from 0 to 1; cover 0 is a transparent one.
    pub background: [f32; 4],
}

/// A picture: `[height][width][4]`, red, green and blue times cover, and cover, from 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendered {
    /// Width and height.
    pub size: [u32; 2],
    /// The numbers.
    pub data: Vec<f32>,
}

impl Renderer {
    /// Room for the points of a plan, all empty.
    ///
    /// # Errors
    /// When device memory runs out or a kernel cannot be made.
    pub fn new(engine: &Engine, plan: RenderPlan) -> Result<Self, OmnixError> {
        let RenderPlan { plan, points, size } = plan;
        let exec = Executable::new(engine.gpu(), plan, &WeightStore::default(), &Bindings::default())?;
        let renderer = Self { exec, points, size };
        renderer.empty(0, points)?;
        Ok(renderer)
    }

    /// Room for this many points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points
    }

    /// Sets the world positions of points from `first` on.
    ///
    /// # Errors
    /// More of them than there is room for.
    pub fn write_positions(&self, first: usize, positions: &[[f32; 3]]) -> Result<(), OmnixError> {
        Ok(self.exec.write_at("points", 3 * first, positions.as_flattened())?)
    }

    /// Sets the radii (in units of the world; negative ones in pixels) and colours (red + 256 green + 65536 blue) of points from `first` on.
    ///
    /// # Errors
    /// As [`Renderer::write_positions`].
    pub fn write_looks(&self, first: usize, sizes: &[f32], colours: &[u32]) -> Result<(), OmnixError> {
        self.exec.write_at("sizes", first, sizes)?;
        Ok(self.exec.write_at("colours", first, bytemuck::cast_slice(colours))?)
    }

    /// Makes `count` places from `first` on empty.
    ///
    /// # Errors
    /// As [`Renderer::write_positions`].
    pub fn empty(&self, first: usize, count: usize) -> Result<(), OmnixError> {
        const PIECE: usize = 1 << 16;
        let nowhere = vec![[f32::NAN; 3]; count.min(PIECE)];
        for start in (0..count).step_by(PIECE) {
            self.write_positions(first + start, &nowhere[..PIECE.min(count - start)])?;
        }
        Ok(())
    }

    /// A picture that stays on the device, `[height, width, 4]` f32, until the next one is made.
    ///
    /// # Errors
    /// When the device is lost.
    pub async fn resident_picture_async(&self, shot: &Shot) -> Result<BufferSlice, OmnixError> {
        let Camera { extrinsics, intrinsics } = &shot.camera;
        let [[fx, skew, cx], [_, fy, cy], _] = *intrinsics;
        let [r, g, b, cover] = shot.background;
        let behind = [r * cover, g * cover, b * cover, cover];
        self.exec.write("view", &view(extrinsics, [fx, skew, cx, fy, cy], shot.near, shot.layer, behind))?;
        self.exec.start().finish(&mut |_, _| ControlFlow::Continue(())).await?;
        Ok(self.exec.slice("picture")?)
    }

    /// A picture in memory of the host.
    ///
    /// # Errors
    /// When the device is lost.
    pub async fn picture_async(&self, shot: &Shot) -> Result<Rendered, OmnixError> {
        self.resident_picture_async(shot).await?;
        Ok(Rendered { size: self.size, data: self.exec.read_async("picture").await? })
    }
}

impl Rendered {
    /// 8-bit red, green, blue; a background that is transparent counts as black.
    #[must_use]
    pub fn rgb8(&self) -> Vec<u8> {
        self.data.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b].map(byte)).collect()
    }

    /// 8-bit red, green, blue and cover, colours not multiplied by cover.
    #[must_use]
    pub fn rgba8(&self) -> Vec<u8> {
        let straight = |[r, g, b, cover]: &[f32; 4]| {
            let [r, g, b] = [r, g, b].map(|v| byte(if *cover > 0.0 { v / cover } else { 0.0 }));
            [r, g, b, byte(*cover)]
        };
        self.data.as_chunks::<4>().0.iter().flat_map(straight).collect()
    }
}

fn byte(value: f32) -> u8 {
    (value * 255.0).round() as u8
}
