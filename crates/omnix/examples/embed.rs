//! The engine inside a program that already has a device: the host opens it, lends it to the engine, and uses the depth of
//! each image in a compute pass of its own, on the device. Only the host's own small result is read back.
//!
//! `cargo run -p omnix --example embed`

#![expect(clippy::print_stdout, reason = "an example prints what it did")]

use omnix::wgpu::{self, util::DeviceExt as _};
use omnix::{Engine, Event, Request, ResidentGeometry, RunPlan, Session, Weights};

/// The host's own kernel: mean depth of one image, by one invocation (a real program would do better).
const SHADER: &str = "
    @group(0) @binding(0) var<storage, read> depth: array<f32>;
    @group(0) @binding(1) var<storage, read_write> mean: array<f32>;
    @group(0) @binding(2) var<uniform> p: vec4<u32>; // count, image

    @compute @workgroup_size(1)
    fn main() {
        var sum = 0.0;
        for (var i = 0u; i < p.x; i++) { sum += depth[i]; }
        mean[p.y] = sum / f32(p.x);
    }
";

const IMAGES: usize = 2;
const SIZE: (usize, usize) = (84, 140);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The host's device. Ask for the engine's features and the adapter's limits if you can; neither is required.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("host"),
        required_features: adapter.features() & Engine::wanted_features(),
        required_limits: adapter.limits(),
        ..Default::default()
    }))?;
    let host = Host::new(&device, &queue);

    // The engine borrows it. With one image at a time through the heads, every depth buffer starts at offset 0.
    let engine = Engine::new(&device, &queue);
    let weights = Weights::builtin()?;
    let (height, width) = SIZE;
    let request = Request::new(IMAGES, height, width).head_images(1);
    let plan = RunPlan::new(&weights, &request, engine.caps())?;
    println!("the engine will take {} MiB", plan.peak_bytes() >> 20);
    let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet())?;
    for image in 0..IMAGES {
        session.set_image(image, &made_up_picture(image))?;
    }
    session.run_resident(&mut |event| {
        if let Event::Resident(frame) = event {
            host.use_depth(&frame);
        }
        Ok(())
    })?;
    println!("mean depth of each image, computed on the device: {:?}", host.read()?);
    Ok(())
}

/// A normalised picture `[3, height, width]`: soft stripes that move from image to image.
fn made_up_picture(image: usize) -> Vec<f32> {
    let (height, width) = SIZE;
    let pixel = |i: usize| ((i % width + 4 * image) as f32 * 0.2).sin() + ((i / width % height) as f32 * 0.3).cos();
    (0..3 * height * width).map(pixel).collect()
}

/// What an application would already have.
struct Host {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    mean: wgpu::Buffer,
}

impl Host {
    fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("mean"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("mean"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let mean = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("mean"),
            size: 4 * IMAGES as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Self { device: device.clone(), queue: queue.clone(), pipeline, mean }
    }

    /// The host's pass over the engine's buffer: no copy, no read-back.
    fn use_depth(&self, frame: &ResidentGeometry) {
        let numbers = [(frame.depth.size / 4) as u32, frame.index as u32, 0, 0];
        let params = self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("count and image"),
            contents: bytemuck::cast_slice(&numbers),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let depth = wgpu::BufferBinding {
            buffer: &frame.depth.buffer,
            offset: frame.depth.offset,
            size: wgpu::BufferSize::new(frame.depth.size),
        };
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                entry(0, wgpu::BindingResource::Buffer(depth)),
                entry(1, self.mean.as_entire_binding()),
                entry(2, params.as_entire_binding()),
            ],
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Two numbers to the host, to show that it worked.
    fn read(&self) -> Result<Vec<f32>, Box<dyn std::error::Error>> {
        let size = self.mean.size();
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.mean, 0, &staging, 0, size);
        self.queue.submit([encoder.finish()]);
        staging.slice(..).map_async(wgpu::MapMode::Read, |_| ());
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        let mapped = staging.slice(..).get_mapped_range()?;
        Ok(bytemuck::cast_slice(&mapped).to_vec())
    }
}
