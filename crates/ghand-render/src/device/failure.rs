//! What can go wrong with a device, and how it is noticed.
//!
//! A device tells of its errors in four ways: the call that opens it fails; a scope catches what the calls inside of it
//! did wrong ([`Gpu::scoped`]); errors outside of scopes come to a handler; and one day the device may be lost. The last
//! two are remembered here, and every call that waits asks for them ([`Gpu::check`]).

use std::error::Error;
use std::sync::{Mutex, MutexGuard, PoisonError};

use wgpu::wgc::binding_model::CreateBindGroupError;
use wgpu::wgc::resource::CreateBufferError;

use crate::device::{AdapterChoice, memory_limit};
use crate::{Gpu, Tier};

/// Why there is no device.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// No adapter fits the choice.
    #[error("no graphics adapter {wanted}{}", adapter_remedy(found))]
    NoAdapter {
        /// What was asked for.
        wanted: String,
        /// What there is.
        found: Vec<String>,
    },
    /// The process may not use the memory that any driver needs.
    #[error(
        "this process may use only {limit_mib} MiB of address space (`ulimit -v`), and a graphics driver needs at least \
         {least_mib}; raise the limit, as with `ulimit -v unlimited`"
    )]
    MemoryLimit {
        /// What the process may use.
        limit_mib: u64,
        /// What a driver needs.
        least_mib: u64,
    },
    /// The adapter refused a device.
    #[error(
        "the graphics adapter {adapter} gave no device: {reason}; update its driver or choose another adapter with {}{}",
        AdapterChoice::VARIABLE,
        memory_limit::hint()
    )]
    NoDevice {
        /// The adapter.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
    /// The adapter lacks what a tier needs.
    #[error("the graphics adapter {adapter} lacks what the tier `{tier}` needs; use {}=baseline", Tier::VARIABLE)]
    NoTier {
        /// The adapter.
        adapter: String,
        /// The tier.
        tier: &'static str,
    },
    /// [`Tier::VARIABLE`] names no tier.
    #[error("{}={text} is no tier; it may be `baseline` or `fast`", Tier::VARIABLE)]
    UnknownTier {
        /// What it holds.
        text: String,
    },
    /// The adapter of a lost device does not come back.
    #[error(
        "the graphics adapter {adapter} was lost and does not come back; update its driver, restart the computer, or \
         choose another adapter with {}",
        AdapterChoice::VARIABLE
    )]
    Gone {
        /// The adapter.
        adapter: String,
    },
}

fn adapter_remedy(found: &[String]) -> String {
    let install = "(Debian or Ubuntu without a GPU: `apt-get install mesa-vulkan-drivers`, or `scripts/setup.sh`)";
    if found.is_empty() {
        return format!("; install a Vulkan driver {install}{}", memory_limit::hint());
    }
    let variable = AdapterChoice::VARIABLE;
    format!(", only {}; choose one of these with {variable} or install the driver of another", found.join(", "))
}

/// Why rendering failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// The device is gone, and with it all that was on it. [`Gpu::reopen`] opens another.
    #[error(
        "the graphics device was lost ({0}); start again, and if it happens again update or reset the graphics driver"
    )]
    Lost(String),
    /// The device has no room for what was asked of it. It goes on working.
    #[error(
        "the graphics device has no room for {what} ({why}); use smaller images or fewer Gaussians, close other \
         programs that use the graphics adapter, or choose another adapter with {}{}",
        AdapterChoice::VARIABLE,
        memory_limit::hint()
    )]
    OutOfMemory {
        /// What was asked for.
        what: String,
        /// What is short.
        why: String,
    },
    /// The device reported an error.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// The request cannot be met.
    #[error("{0}")]
    Invalid(String),
}

/// What a device has reported so far.
#[derive(Debug, Default)]
pub(super) struct Reports {
    lost: Option<String>,
    first: Option<String>,
    later: usize,
}

/// A place for the reports of one device, whatever thread they come on.
#[derive(Debug, Default)]
pub(super) struct Failure(Mutex<Reports>);

impl Failure {
    fn reports(&self) -> MutexGuard<'_, Reports> {
        // Whoever panicked meanwhile left nothing half done: every change is one assignment.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps the first error and counts the others.
    pub fn record_error(&self, error: &wgpu::Error) {
        let message = one_line(&error.to_string());
        let mut reports = self.reports();
        if reports.first.is_some() {
            reports.later += 1;
            log::debug!("another error of the graphics device: {message}");
        } else {
            log::error!("the graphics device failed: {message}");
            reports.first = Some(message);
        }
    }

    /// Keeps the first reason of the loss.
    pub fn record_loss(&self, reason: wgpu::DeviceLostReason, message: &str) {
        let message = match (reason, one_line(message)) {
            (wgpu::DeviceLostReason::Destroyed, _) => "it was destroyed".to_owned(),
            (_, message) if message.is_empty() => "the driver gave no reason".to_owned(),
            // As the driver's sentences end, which here goes into brackets.
            (_, message) => message.trim_end_matches('.').to_owned(),
        };
        if reason != wgpu::DeviceLostReason::Destroyed {
            log::error!("the graphics device was lost: {message}");
        }
        self.reports().lost.get_or_insert(message);
    }
}

impl Gpu {
    /// Whether the device is known to be lost. It shows at the latest in the next [`Gpu::wait`] or [`Gpu::poll`].
    pub fn is_lost(&self) -> bool {
        self.failure.reports().lost.is_some()
    }

    /// Fails if the device was lost or has reported an error outside of a scope.
    ///
    /// # Errors
    /// [`RenderError::Lost`] with the reason, or [`RenderError::Device`] with the first message and the number of the
    /// others.
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

    /// Takes note of what the device has finished, without waiting.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn poll(&self) -> Result<(), RenderError> {
        self.look(false)
    }

    /// Waits until everything submitted has run. Of a lost device nothing is waited for.
    ///
    /// A callback of a buffer's mapping may never be called on a device that is lost meanwhile: look, after this, whether
    /// it was; do not wait for it.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub fn wait(&self) -> Result<(), RenderError> {
        self.look(true)
    }

    fn look(&self, wait: bool) -> Result<(), RenderError> {
        // Not before an error is told: it may be the first sign of a loss that shows only now.
        if !self.is_lost() {
            // Not `Device::poll`: that panics where the driver answers that the device is lost. This comes to the same,
            // since an instance has one device here, and what the driver answers is recorded.
            self.instance.poll_all(wait);
        }
        self.check()
    }

    /// Runs `make`, which makes `what` on the device (buffers, textures, pipelines), and fails if any of it could not be
    /// made. Nothing of that is left behind as an error of the device, which goes on working unless it is lost.
    ///
    /// It looks at the device before and after: for what is done once, not for every frame.
    ///
    /// # Errors
    /// [`RenderError::OutOfMemory`] if there is no room, [`RenderError::Device`] if the device refuses it for another
    /// reason (a shader that does not compile), [`RenderError::Lost`] if the device is lost.
    pub fn scoped<T>(&self, what: &str, make: impl FnOnce() -> T) -> Result<T, RenderError> {
        // A lost device makes nothing and reports no error.
        self.poll()?;
        let scopes = [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory]
            .map(|filter| self.device.push_error_scope(filter));
        let made = make();
        // The innermost first; what is missing for lack of memory is then invalid, so that the lack comes first, too.
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
    let too_large = causes(error).find_map(|cause| {
        let (bytes, most) = match (cause.downcast_ref(), cause.downcast_ref()) {
            (Some(CreateBufferError::MaxBufferSize { requested, maximum }), _) => (requested, maximum),
            (_, Some(CreateBindGroupError::BufferRangeTooLarge { given, limit, .. })) => (given, limit),
            _ => return None,
        };
        Some(format!("a buffer of {bytes} bytes, it takes at most {most}"))
    });
    match (too_large, error) {
        (Some(why), _) => RenderError::OutOfMemory { what, why },
        (None, wgpu::Error::OutOfMemory { .. }) => RenderError::OutOfMemory { what, why: "its memory is full".into() },
        (None, error) => RenderError::Device(format!("it refuses {what}: {}", one_line(&error.to_string()))),
    }
}

fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |e| (*e).source())
}

/// A message of wgpu as a part of a sentence.
fn one_line(text: &str) -> String {
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    words.strip_prefix("Validation Error Caused by: ").unwrap_or(&words).to_owned()
}
