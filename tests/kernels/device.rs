//! What `Gpu` does beside running kernels.

use omnix_kernels::{Gpu, KernelError, adapter};
use omnix_tests::{Trial, trials};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "device",
        once: [everyone_on_a_device_learns_of_its_loss, a_host_with_its_own_callback_reports_the_loss],
    )
}

fn everyone_on_a_device_learns_of_its_loss() {
    let adapter = adapter::choose(std::env::var("OMNIX_DEVICE").ok().as_deref()).expect("a device");
    let open = || adapter::open(&adapter).expect("opens");
    let ((device, queue), (other_device, other_queue)) = (open(), open());
    let users: Vec<Gpu> = (0..3).map(|_| Gpu::new(&device, &queue)).collect();
    let stranger = Gpu::new(&other_device, &other_queue);
    assert!(users.iter().all(|gpu| gpu.check_lost().is_ok()));
    device.destroy();
    let _ = device.poll(wgpu::PollType::Poll);
    for (i, gpu) in users.iter().enumerate() {
        let lost = gpu.check_lost();
        assert!(matches!(lost, Err(KernelError::DeviceLost { .. })), "user {i}: {lost:?}");
    }
    stranger.check_lost().expect("another device is not lost");
}

fn a_host_with_its_own_callback_reports_the_loss() {
    let adapter = adapter::choose(std::env::var("OMNIX_DEVICE").ok().as_deref()).expect("a device");
    let (device, queue) = adapter::open(&adapter).expect("opens");
    let gpu = Gpu::new(&device, &queue);
    let theirs = gpu.clone();
    device.set_device_lost_callback(move |_, message| theirs.report_lost(&message));
    device.destroy();
    let _ = device.poll(wgpu::PollType::Poll);
    assert!(matches!(gpu.check_lost(), Err(KernelError::DeviceLost { .. })));
}
