//! Whether a device has been lost.
//!
//! wgpu keeps one device-lost callback per device and drops the one before when another is set. So that several users of one
//! device all learn of its loss, our callback carries a list of flags, and when a later one of ours takes its place, the list moves
//! on to that: wgpu drops the old callback inside the call that sets the new one, which is how the two find each other.

use std::cell::RefCell;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// A flag that says once that a device was lost, with the driver's words. Clones share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lost(Arc<OnceLock<String>>);

type Flags = Arc<Mutex<Vec<Lost>>>;

thread_local! {
    /// The flags of the callback that is being set on this thread; a callback of ours dropped meanwhile was the device's until now.
    static HEIR: RefCell<Option<Flags>> = const { RefCell::new(None) };
}

impl Lost {
    /// A flag that is set when `device` is lost. Takes the device's callback; flags from earlier calls stay connected.
    pub(crate) fn watch(device: &wgpu::Device) -> Self {
        let flag = Self::default();
        let flags: Flags = Arc::new(Mutex::new(vec![flag.clone()]));
        let callback = Callback { flags: Arc::clone(&flags) };
        HEIR.set(Some(flags));
        device.set_device_lost_callback(move |reason, message| callback.call(&format!("{reason:?}: {message}")));
        HEIR.set(None);
        flag
    }

    /// Sets the flag; the first message stays.
    pub(crate) fn set(&self, message: String) {
        let _ = self.0.set(message);
    }

    /// The driver's words, if the device was lost.
    pub(crate) fn message(&self) -> Option<&str> {
        self.0.get().map(String::as_str)
    }
}

/// What the device's callback owns.
struct Callback {
    flags: Flags,
}

impl Callback {
    fn call(&self, message: &str) {
        for flag in self.flags.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            flag.set(message.to_owned());
        }
    }
}

impl Drop for Callback {
    fn drop(&mut self) {
        HEIR.with_borrow(|heir| {
            let Some(heir) = heir else { return };
            let mut mine = self.flags.lock().unwrap_or_else(PoisonError::into_inner);
            // A flag that nobody else holds any longer has no reader.
            mine.retain(|flag| Arc::strong_count(&flag.0) > 1);
            heir.lock().unwrap_or_else(PoisonError::into_inner).append(&mut mine);
        });
    }
}
