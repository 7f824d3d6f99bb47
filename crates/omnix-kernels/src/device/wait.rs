//! Waiting for a device: futures, and for programs with a thread to spare the same as blocking calls.
//!
//! In a browser the device works only while the page's thread is free, so everything that waits there is a future. Elsewhere
//! wgpu's callbacks run only while somebody polls the device: there the same futures poll it themselves, which blocks the thread, and
//! are ready when they are first asked. So any executor drives them, and `pollster` is enough.

use futures_channel::oneshot;

use crate::{Gpu, KernelError};

impl Gpu {
    /// Waits until everything submitted has run.
    ///
    /// # Errors
    /// [`KernelError::DeviceLost`]; in a browser also what went wrong since the last wait.
    pub async fn wait_async(&self) -> Result<(), KernelError> {
        self.reached(wgpu::PollType::wait_indefinitely()).await
    }

    /// Waits until a submission has run; later ones go on. (A browser tells only when everything submitted by now has.)
    ///
    /// # Errors
    /// As [`Gpu::wait_async`].
    pub async fn wait_for_async(&self, submission: wgpu::SubmissionIndex) -> Result<(), KernelError> {
        self.reached(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None }).await
    }

    async fn reached(&self, until: wgpu::PollType) -> Result<(), KernelError> {
        if cfg!(target_arch = "wasm32") {
            let (done, reached) = oneshot::channel();
            self.queue.on_submitted_work_done(move || {
                let _ = done.send(());
            });
            // A callback that is dropped says the same as one that is called: there is nothing to wait for.
            let _ = reached.await;
            self.check_lost()?;
            return self.failed();
        }
        let polled = self.device.poll(until);
        self.check_lost()?;
        polled.map_err(|error| KernelError::DeviceLost { message: error.to_string() })?;
        Ok(())
    }

    /// What an error scope found, as the error that `failed` makes of it. A browser says so later: there this is `Ok`, what was made is not
    /// valid, and the next wait returns the error.
    pub(crate) fn settle(
        &self,
        scope: wgpu::ErrorScopeGuard,
        failed: impl FnOnce(wgpu::Error) -> KernelError + 'static,
    ) -> Result<(), KernelError> {
        #[cfg(not(target_arch = "wasm32"))]
        return pollster::block_on(scope.pop()).map_or(Ok(()), |error| Err(failed(error)));
        #[cfg(target_arch = "wasm32")]
        {
            let found = scope.pop();
            let gpu = self.clone();
            wasm_bindgen_futures::spawn_local(async move {
                if let Some(error) = found.await {
                    gpu.fail(failed(error));
                }
            });
            Ok(())
        }
    }
}

#[cfg(not(target_arch = "wasm32"))]
impl Gpu {
    /// As [`Gpu::wait_async`], blocking.
    ///
    /// # Errors
    /// As there.
    pub fn wait(&self) -> Result<(), KernelError> {
        pollster::block_on(self.wait_async())
    }

    /// As [`Gpu::wait_for_async`], blocking.
    ///
    /// # Errors
    /// As there.
    pub fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<(), KernelError> {
        pollster::block_on(self.wait_for_async(submission))
    }
}
