//! Networks whose results depend on all images: monocular and metric ones, whose sky is as far as the farthest pixel of all images,
//! and nested ones, which get the metre from all of them (`spec/da3.md` 7.1 and 10). Maps wait on the host until the last image is
//! done, and are put together there.

use omnix_geometry::{CANONICAL_FOCAL, Camera, MetricView, fill_metric_sky, fill_sky, metric_scale};
use omnix_graph::Plan;
use omnix_kernels::BufferSlice;
use omnix_kernels::readback::read_async;

use super::Session;
use super::handover::{fill, inputs, part};
use super::masked::hide_sky;
use super::on_device::PhasePart;
use super::readback::{Results, scaled_gaussians};
use crate::error::OmnixError;
use crate::event::{Event, FrameGeometry, Listener, Phase, ResidentGeometry};

/// One map of every image.
type Maps = Vec<Vec<f32>>;

/// Maps of all images, as they wait. A map that there is not has no images.
#[derive(Default)]
struct Waiting {
    depth: Maps,
    confidence: Maps,
    sky: Maps,
    rays: Maps,
    ray_confidence: Maps,
    gaussians: Maps,
}

impl Waiting {
    /// Image `index`'s results; its maps are gone from here.
    fn take(&mut self, index: usize, camera: Option<Camera>) -> FrameGeometry {
        let take = |maps: &mut Maps| maps.get_mut(index).map(std::mem::take);
        FrameGeometry {
            index,
            depth: take(&mut self.depth).unwrap_or_default(),
            confidence: take(&mut self.confidence),
            sky: take(&mut self.sky),
            camera,
            rays: take(&mut self.rays).zip(take(&mut self.ray_confidence)),
            gaussians: take(&mut self.gaussians),
            features: Vec::new(),
        }
    }
}

impl Session {
    /// All stages, then every image's results.
    pub(super) async fn run_joined(&mut self, listener: Listener<'_>, results: &Results) -> Result<(), OmnixError> {
        let metric = self.run_metric(listener).await?;
        let mut made = self.run_backbone(listener).await?;
        let (head, step) = (self.plan.head.clone(), self.plan.head_images);
        let whole = PhasePart { phase: Phase::Head, before: 0, total: self.plan.head_flops() };
        let mut waiting =
            self.read_head(&head, step, (&made.features[..], made.pictures.as_ref()), whole, listener).await?;
        (made.features, made.pictures) = (Vec::new(), None);
        hide_sky(&mut waiting.sky, self.plan.request.masks.as_deref());
        match metric {
            Some([metric, sky]) => {
                let scale = to_metres(&mut waiting, &metric, sky, &mut made.cameras)?;
                listener(Event::MetricScale(scale))?;
                self.align(&mut made, listener)?;
                let scaled = waiting.depth.iter_mut().flatten();
                scaled.for_each(|depth| *depth *= made.depth_scale);
                let shift = scale as f32 * made.depth_scale;
                for numbers in &mut waiting.gaussians {
                    *numbers = scaled_gaussians(std::mem::take(numbers), shift);
                }
            }
            None => {
                fill_sky(&mut waiting.depth, &waiting.sky);
                // Known cameras of a metric network: their focal lengths give the metre.
                made.cameras = self.plan.request.cameras.clone().unwrap_or_default();
                for (depth, camera) in waiting.depth.iter_mut().zip(&made.cameras) {
                    let metres = (focal(camera) / CANONICAL_FOCAL) as f32;
                    depth.iter_mut().for_each(|depth| *depth *= metres);
                }
            }
        }
        for index in 0..self.plan.request.images {
            let mut frame = waiting.take(index, made.cameras.get(index).copied());
            for (block, all) in made.exports_of(index) {
                frame.features.push((block, read_async::<f32>(self.engine.gpu(), &all).await?));
            }
            match results {
                Results::Readbacks(_) => listener(Event::Frame(frame))?,
                Results::Resident => listener(Event::Resident(self.upload(&frame)?))?,
            }
        }
        Ok(())
    }

    /// Depth and sky of the metric network of a nested one.
    async fn run_metric(&self, listener: Listener<'_>) -> Result<Option<[Maps; 2]>, OmnixError> {
        let Some(plan) = self.plan.metric.clone() else { return Ok(None) };
        let head_flops = plan.head.flops() * plan.head_runs(self.plan.request.images) as u64;
        let total = plan.backbone.flops() + head_flops;
        let part = PhasePart { phase: Phase::Metric, before: 0, total };
        let backbone = self.weights.stage(&plan.backbone, &self.image_bindings(), listener).await?;
        backbone.run(part, listener).await?;
        let features = (0..4).map(|k| backbone.slice(&format!("feat.{k}"))).collect::<Result<Vec<_>, _>>()?;
        drop(backbone);
        let part = PhasePart { before: plan.backbone.flops(), ..part };
        let Waiting { mut depth, mut sky, .. } =
            self.read_head(&plan.head, plan.head_images, (&features[..], None), part, listener).await?;
        hide_sky(&mut sky, self.plan.request.masks.as_deref());
        fill_sky(&mut depth, &sky);
        Ok(Some([depth, sky]))
    }

    /// Runs a head over all images, `step` at a time, and reads all it makes.
    async fn read_head(
        &self,
        plan: &Plan,
        step: usize,
        seen: (&[BufferSlice], Option<&BufferSlice>),
        of: PhasePart,
        listener: Listener<'_>,
    ) -> Result<Waiting, OmnixError> {
        let (gpu, images) = (self.engine.gpu(), self.plan.request.images);
        let runs = images.div_ceil(step);
        let head = self.weights.stage(plan, &inputs(seen.0, seen.1, runs), listener).await?;
        let mut waiting = Waiting::default();
        for first in (0..images).step_by(step) {
            let count = step.min(images - first);
            if runs > 1 {
                fill(gpu, &head, seen, (first, count, images))?;
            }
            let before = of.before + plan.flops() * (first / step) as u64;
            head.run(PhasePart { before, ..of }, listener).await?;
            for i in 0..count {
                let maps = [
                    ("depth", &mut waiting.depth),
                    ("depth_conf", &mut waiting.confidence),
                    ("sky", &mut waiting.sky),
                    ("ray", &mut waiting.rays),
                    ("ray_conf", &mut waiting.ray_confidence),
                    ("gaussians", &mut waiting.gaussians),
                ];
                for (name, maps) in maps {
                    if plan.graph.outputs().iter().any(|v| plan.graph.value_name(*v) == name) {
                        maps.push(read_async::<f32>(gpu, &part(&head, name, i, step)?).await?);
                    }
                }
            }
        }
        Ok(waiting)
    }

    /// An image's results on the device again. Buffers live as long as whoever is told of them keeps them.
    fn upload(&self, frame: &FrameGeometry) -> Result<ResidentGeometry, OmnixError> {
        let gpu = self.engine.gpu();
        let upload = |name: &str, numbers: &Vec<f32>| -> Result<BufferSlice, OmnixError> {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
            let buffer = gpu.buffer(name, size_of_val(numbers.as_slice()) as u64, usage)?;
            gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(numbers));
            Ok(buffer.into())
        };
        let rays = frame
            .rays
            .as_ref()
            .map(|(rays, confidence)| Ok::<_, OmnixError>((upload("ray", rays)?, upload("ray_conf", confidence)?)));
        Ok(ResidentGeometry {
            index: frame.index,
            depth: upload("depth", &frame.depth)?,
            confidence: frame.confidence.as_ref().map(|c| upload("depth_conf", c)).transpose()?,
            sky: frame.sky.as_ref().map(|sky| upload("sky", sky)).transpose()?,
            camera: frame.camera,
            depth_scale: 1.0,
            rays: rays.transpose()?,
            gaussians: frame.gaussians.as_ref().map(|numbers| upload("gaussians", numbers)).transpose()?,
            features: frame
                .features
                .iter()
                .map(|(block, map)| Ok((*block, upload("features", map)?)))
                .collect::<Result<_, OmnixError>>()?,
            points: None,
        })
    }
}

/// Mean of fx and fy.
fn focal(camera: &Camera) -> f64 {
    f64::from(camera.intrinsics[0][0]).midpoint(f64::from(camera.intrinsics[1][1]))
}

/// Brings what the any-view network says of all images to metres, and its sky to where the metric network's is; returns metres in a
/// unit of its depth. World positions are in metres too: camera centres and the origins of rays.
fn to_metres(waiting: &mut Waiting, metric: &Maps, sky: Maps, cameras: &mut [Camera]) -> Result<f64, OmnixError> {
    let views = metric.iter().zip(&waiting.depth).zip(&waiting.confidence).zip(&sky).zip(cameras.iter());
    let views = views.map(|((((metric, depth), confidence), sky), camera)| MetricView {
        metric,
        depth,
        confidence,
        sky,
        focal: focal(camera),
    });
    let scale = metric_scale(&views.collect::<Vec<_>>())?;
    let metres = scale as f32;
    waiting.depth.iter_mut().flatten().for_each(|depth| *depth *= metres);
    for ray in waiting.rays.iter_mut().flat_map(|rays| rays.chunks_exact_mut(6)) {
        ray[3..].iter_mut().for_each(|origin| *origin *= metres);
    }
    for row in cameras.iter_mut().flat_map(|camera| &mut camera.extrinsics) {
        row[3] *= metres;
    }
    fill_metric_sky(&mut waiting.depth, &mut waiting.confidence, &sky);
    waiting.sky = sky;
    Ok(scale)
}
