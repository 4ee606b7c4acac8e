//! Errors of a device, and how they are detected.
//!
//! A device reports errors in four ways: the call that opens it fails; a scope catches the errors of the calls inside
//! it ([`Gpu::scoped`]); errors outside scopes go to a handler; and the device can be lost. The last two are recorded
//! here, and every call that waits checks them ([`Gpu::check`]).

use std::future::poll_fn;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Poll, Waker};

use crate::device::AdapterChoice;
use crate::{Gpu, Tier};

/// Why a device could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// No adapter fits the choice.
    #[error("no graphics adapter {wanted}{}", adapter_remedy(found))]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// The available adapters.
        found: Vec<String>,
    },
    /// The adapter did not give a device.
    #[error(
        "the graphics adapter {adapter} could not be opened: {reason}; update its driver or choose another adapter \
         with {}",
        AdapterChoice::VARIABLE
    )]
    NoDevice {
        /// The adapter.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// The adapter lacks what a tier needs.
    #[error("the graphics adapter {adapter} lacks what the tier `{tier}` needs; use {}=gpu, or cpu", Tier::VARIABLE)]
    NoTier {
        /// The adapter.
        adapter: String,
        /// The tier.
        tier: &'static str,
    },
    /// [`Tier::VARIABLE`] is not the name of a tier.
    #[error("{}={text} is not a tier; use `cpu`, `cpu-subgroups`, `gpu` or `gpu-subgroups`", Tier::VARIABLE)]
    UnknownTier {
        /// Its value.
        text: String,
    },
    /// The caller's device allows less than every WebGPU device.
    #[error(
        "the device allows {limit} of {allowed}, and {needed} is needed; request it with `wgpu::Limits::default()`"
    )]
    SmallLimits {
        /// The limit.
        limit: &'static str,
        /// What is needed.
        needed: u64,
        /// What the device allows.
        allowed: u64,
    },
    /// The adapter of a lost device did not come back.
    #[error(
        "the graphics adapter {adapter} was lost and did not come back; update its driver, restart the computer, or \
         choose another adapter with {}",
        AdapterChoice::VARIABLE
    )]
    Gone {
        /// The adapter.
        adapter: String,
    },
}

fn adapter_remedy(found: &[String]) -> String {
    if cfg!(target_arch = "wasm32") {
        return "; turn on hardware acceleration in the browser's settings, or use another browser".into();
    }
    let install = "(Debian or Ubuntu without a GPU: `apt-get install mesa-vulkan-drivers`, or `scripts/setup.sh`)";
    if found.is_empty() {
        return format!("; install a Vulkan driver {install}");
    }
    let variable = AdapterChoice::VARIABLE;
    format!(", only {}; choose one of these with {variable} or install the driver of another", found.join(", "))
}

/// Why rendering failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// The device and its contents are lost. [`Gpu::reopen`] opens a new one.
    #[error(
        "the graphics device was lost ({0}); start again, and if it happens again update or reset the graphics driver"
    )]
    Lost(String),
    /// The device has too little memory for a request. It remains usable.
    #[error(
        "the graphics device has too little memory for {what} ({why}); use smaller images or fewer Gaussians, close \
         other programs that use the graphics adapter, or choose another adapter with {}",
        AdapterChoice::VARIABLE
    )]
    OutOfMemory {
        /// What was asked for.
        what: String,
        /// The reason, such as the exceeded limit.
        why: String,
    },
    /// The device reported an error.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// The request is invalid.
    #[error("{0}")]
    Invalid(String),
}

/// The errors that a device has reported so far.
#[derive(Debug, Default)]
pub(super) struct Reports {
    lost: Option<String>,
    first: Option<String>,
    later: usize,
    /// Who waits for the loss.
    waiting: Vec<Waker>,
}

/// Collects the reports of one device from all threads.
#[derive(Debug, Default)]
pub(super) struct Failure(Mutex<Reports>);

impl Failure {
    fn reports(&self) -> MutexGuard<'_, Reports> {
        // A thread that panicked with the lock cannot have left a partial change: every change is one assignment.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records the first error and counts the others.
    pub fn record_error(&self, error: &wgpu::Error) {
        let message = one_line(&error.to_string());
        let mut reports = self.reports();
        if reports.first.is_some() {
            reports.later += 1;
            log::debug!("another graphics device error: {message}");
        } else {
            log::error!("the graphics device failed: {message}");
            reports.first = Some(message);
        }
    }

    /// Records the first reason of the loss.
    pub fn record_loss(&self, reason: wgpu::DeviceLostReason, message: &str) {
        let message = match (reason, one_line(message)) {
            (wgpu::DeviceLostReason::Destroyed, _) => "it was destroyed".to_owned(),
            (_, message) if message.is_empty() => "no reason given by the driver".to_owned(),
            // The message is put in parentheses, without its full stop.
            (_, message) => message.trim_end_matches('.').to_owned(),
        };
        if reason != wgpu::DeviceLostReason::Destroyed {
            log::error!("the graphics device was lost: {message}");
        }
        let mut reports = self.reports();
        reports.lost.get_or_insert(message);
        let waiting = std::mem::take(&mut reports.waiting);
        drop(reports);
        waiting.into_iter().for_each(Waker::wake);
    }
}

impl Gpu {
    /// Whether the device is known to be lost. A loss is detected at the latest in the next [`Gpu::wait`] or
    /// [`Gpu::poll`].
    pub fn is_lost(&self) -> bool {
        self.failure.reports().lost.is_some()
    }

    /// Resolves with the reason once the device is known to be lost: for programs that do not draw all the time. It does
    /// not keep the device open.
    pub fn lost(&self) -> impl Future<Output = String> + use<> {
        let failure = self.failure.clone();
        poll_fn(move |context| {
            let mut reports = failure.reports();
            match &reports.lost {
                Some(reason) => Poll::Ready(reason.clone()),
                None => {
                    reports.waiting.push(context.waker().clone());
                    Poll::Pending
                }
            }
        })
    }

    /// Fails if the device was lost or has reported an error outside a scope.
    ///
    /// # Errors
    /// [`RenderError::Lost`] with the reason, or [`RenderError::Device`] with the first message and the number of later
    /// errors.
    pub fn check(&self) -> Result<(), RenderError> {
        let reports = self.failure.reports();
        if let Some(reason) = &reports.lost {
            return Err(RenderError::Lost(reason.clone()));
        }
        match (&reports.first, reports.later) {
            (None, _) => Ok(()),
            (Some(first), 0) => Err(RenderError::Device(first.clone())),
            (Some(first), later) => Err(RenderError::Device(format!("{first} (and {later} more errors after it)"))),
        }
    }

    /// Runs the callbacks of finished work and checks for errors, without waiting.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn poll(&self) -> Result<(), RenderError> {
        self.look(false)
    }

    /// Waits until all submitted work has run. Returns at once if the device is lost.
    ///
    /// If the device is lost meanwhile, the callback of a buffer mapping may never be called: after this call, check
    /// whether it was, without waiting for it.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn wait(&self) -> Result<(), RenderError> {
        self.look(true)
    }

    fn look(&self, wait: bool) -> Result<(), RenderError> {
        // Before the check for errors: the first error can be a sign of a loss that only this call detects.
        if !self.is_lost() {
            match &self.instance {
                // Not `Device::poll`, which panics if the driver reports a lost device. This is equivalent, since an
                // instance has one device here, and the driver's reports are recorded.
                Some(instance) => drop(instance.poll_all(wait)),
                None => {
                    let kind = if wait { wgpu::PollType::wait_indefinitely() } else { wgpu::PollType::Poll };
                    self.device.poll(kind).map_err(|e| RenderError::Device(e.to_string()))?;
                }
            }
        }
        self.check()
    }

    /// Runs `make`, which makes `what` on the device (buffers, textures, pipelines), and fails if any part of it could
    /// not be made. The failure is not recorded as an error of the device, which remains usable unless it is lost.
    ///
    /// It polls the device before and after: use it for setup, not in every frame.
    ///
    /// # Errors
    /// [`RenderError::OutOfMemory`] if there is too little memory, [`RenderError::Device`] if the device rejects it for
    /// another reason (a shader that does not compile), [`RenderError::Lost`] if the device is lost.
    pub fn scoped<T>(&self, what: &str, make: impl FnOnce() -> T) -> Result<T, RenderError> {
        if cfg!(target_arch = "wasm32") {
            // A browser reports errors later: to the device's callback, whose reports `check` has.
            let made = make();
            return self.check().map(|()| made);
        }
        // On a lost device, calls have no effect and report no error.
        self.poll()?;
        let scopes = [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory]
            .map(|filter| self.device.push_error_scope(filter));
        let made = make();
        // Innermost first, which is lack of memory: it is the cause of the validation errors that follow from it.
        let errors: Vec<wgpu::Error> =
            scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
        self.poll()?;
        match errors.first() {
            None => Ok(made),
            Some(error) => Err(refusal(what, error)),
        }
    }
}

/// The error of a call that made `what`.
fn refusal(what: &str, error: &wgpu::Error) -> RenderError {
    let what = what.to_owned();
    match (exceeded_size(error), error) {
        (Some(why), _) => RenderError::OutOfMemory { what, why },
        (None, wgpu::Error::OutOfMemory { .. }) => RenderError::OutOfMemory { what, why: "its memory is full".into() },
        (None, error) => RenderError::Device(format!("it rejects {what}: {}", one_line(&error.to_string()))),
    }
}

/// The size of a buffer, and the largest that the device allows, if that is the cause.
#[cfg(not(target_arch = "wasm32"))]
fn exceeded_size(error: &wgpu::Error) -> Option<String> {
    use wgpu::wgc::binding_model::CreateBindGroupError;
    use wgpu::wgc::resource::CreateBufferError;
    causes(error).find_map(|cause| {
        let (bytes, most) = match (cause.downcast_ref(), cause.downcast_ref()) {
            (Some(CreateBufferError::MaxBufferSize { requested, maximum }), _) => (requested, maximum),
            (_, Some(CreateBindGroupError::BufferRangeTooLarge { given, limit, .. })) => (given, limit),
            _ => return None,
        };
        Some(format!("a buffer of {bytes} bytes, but it takes at most {most}"))
    })
}

/// Browsers give only a text.
#[cfg(target_arch = "wasm32")]
fn exceeded_size(_: &wgpu::Error) -> Option<String> {
    None
}

#[cfg(not(target_arch = "wasm32"))]
fn causes<'a>(
    error: &'a (dyn std::error::Error + 'static),
) -> impl Iterator<Item = &'a (dyn std::error::Error + 'static)> {
    std::iter::successors(Some(error), |e| (*e).source())
}

/// A message of wgpu on one line, to be part of a sentence.
fn one_line(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    words.strip_prefix("Validation Error Caused by: ").unwrap_or(&words).to_owned()
}
