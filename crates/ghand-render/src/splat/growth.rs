//! Grows a splatter's buffers without waiting: the counters of a frame arrive some frames later.

use std::sync::{Arc, Mutex, PoisonError};

use super::{Counters, Splatter};
use crate::{Gpu, RenderError};

/// The way of the counters back to the host.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum Way {
    /// Nothing was asked.
    #[default]
    Free,
    /// A frame has been encoded.
    Asked,
    /// They can be read.
    Arrived,
    /// The device could not give them.
    Failed,
}

/// A question to the device. If the host drops the commands instead of submitting them, nothing answers, and the next frame
/// asks again.
struct Question(Arc<Mutex<Way>>);

impl Question {
    fn answer(&self, way: Way) {
        Growth::set(&self.0, way);
    }
}

impl Drop for Question {
    fn drop(&mut self) {
        let mut way = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if *way == Way::Asked {
            *way = Way::Free;
        }
    }
}

/// Reads counters back without waiting.
#[derive(Debug)]
pub struct Growth {
    staging: wgpu::Buffer,
    way: Arc<Mutex<Way>>,
}

impl Growth {
    fn new(gpu: &Gpu) -> Growth {
        let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("counters read back"),
            size: size_of::<Counters>() as u64,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Growth { staging, way: Arc::default() }
    }

    fn way(&self) -> Way {
        *self.way.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(way: &Mutex<Way>, value: Way) {
        *way.lock().unwrap_or_else(PoisonError::into_inner) = value;
    }

    /// The counters that have arrived since the last call.
    fn arrived(&self) -> Result<Option<Counters>, RenderError> {
        match self.way() {
            Way::Free | Way::Asked => Ok(None),
            Way::Failed => {
                Growth::set(&self.way, Way::Free);
                Err(RenderError::Device("the counters of a frame could not be read".into()))
            }
            Way::Arrived => {
                let fail = |e| RenderError::Device(format!("the counters of a frame could not be read: {e}"));
                let counters = bytemuck::pod_read_unaligned(&self.staging.get_mapped_range(..).map_err(fail)?);
                self.staging.unmap();
                Growth::set(&self.way, Way::Free);
                Ok(Some(counters))
            }
        }
    }

    /// Encodes the copy of a frame's counters, unless earlier ones are still on their way.
    fn ask(&self, encoder: &mut wgpu::CommandEncoder, counters: &wgpu::Buffer) {
        if self.way() != Way::Free {
            return;
        }
        Growth::set(&self.way, Way::Asked);
        encoder.copy_buffer_to_buffer(counters, 0, &self.staging, 0, size_of::<Counters>() as u64);
        let question = Question(self.way.clone());
        encoder.map_buffer_on_submit(&self.staging, wgpu::MapMode::Read, .., move |result| {
            question.answer(if result.is_ok() { Way::Arrived } else { Way::Failed });
        });
    }
}

impl Splatter {
    /// As [`Splatter::forward`], for a host that draws frame after frame and never waits. Counters of an earlier frame are
    /// looked at when the device has them, and the buffers grow if that frame lacked Gaussians. Returns whether they have
    /// grown just now: if nothing moves, draw again.
    ///
    /// # Errors
    /// As [`Splatter::complete_for`].
    pub fn forward_growing(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<bool, RenderError> {
        let arrived = match &self.growth {
            Some(growth) => growth.arrived()?,
            None => None,
        };
        let complete = arrived.map_or(Ok(true), |counters| self.complete_for(gpu, &counters))?;
        self.forward(encoder);
        let counters = &self.shared.counters;
        self.growth.get_or_insert_with(|| Growth::new(gpu)).ask(encoder, counters);
        Ok(!complete)
    }
}
