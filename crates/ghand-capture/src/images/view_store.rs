//! Views cropped to the hand, decoded in the background and cached in bounded memory.

use std::sync::Arc;
use std::time::Duration;

use ghand_core::Camera;
use quick_cache::sync::{Cache, DefaultLifecycle, GuardResult};
use quick_cache::{DefaultHashBuilder as Hasher, OptionsBuilder, Weighter};

use super::view::CroppedView;
use crate::capture::Capture;
use crate::error::CaptureError;

/// Options of a [`ViewStore`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ViewStoreOptions {
    /// Pixels kept around the mask.
    pub margin: u32,
    /// Most bytes of cached pixels. Views in use or being decoded take additional memory.
    pub capacity: u64,
    /// Number of decoding threads; one per core if absent.
    pub threads: Option<usize>,
}

impl Default for ViewStoreOptions {
    fn default() -> Self {
        ViewStoreOptions { margin: 16, capacity: 1 << 30, threads: None }
    }
}

/// Camera and frame, indices into those of the capture.
type Pair = (usize, usize);
type Lifecycle = DefaultLifecycle<Pair, Arc<CroppedView>>;

#[derive(Debug, Clone, Copy)]
struct Bytes;

impl Weighter<Pair, Arc<CroppedView>> for Bytes {
    fn weight(&self, _: &Pair, view: &Arc<CroppedView>) -> u64 {
        (size_of::<CroppedView>() + size_of::<Camera>() + size_of_val(view.pixels.as_slice())) as u64
    }
}

struct Shared {
    capture: Capture,
    margin: u32,
    cache: Cache<Pair, Arc<CroppedView>, Bytes>,
}

/// The views of a capture, cropped to the hand. The result depends only on the pair, not on the cache or the time of
/// decoding.
pub struct ViewStore {
    shared: Arc<Shared>,
    pool: rayon::ThreadPool,
}

impl ViewStore {
    /// A store of the views of a capture, initially empty.
    ///
    /// # Errors
    /// [`CaptureError::Io`] if the system cannot create threads.
    pub fn new(capture: &Capture, options: &ViewStoreOptions) -> Result<ViewStore, CaptureError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads.unwrap_or(0))
            .thread_name(|i| format!("decode {i}"))
            .build()
            .map_err(|error| CaptureError::Io {
                path: capture.root.clone(),
                action: "start the threads that decode images",
                source: std::io::Error::other(error),
                remedy: "free some memory",
            })?;
        // One shard: the bound is for all views together. Views have about half a megabyte.
        let options_of_cache = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity((options.capacity >> 19).max(16) as usize)
            .weight_capacity(options.capacity)
            // Passes over all views do not favour views that were used twice.
            .hot_allocation(0.5)
            .build()
            .map_err(|error| CaptureError::Invalid {
                path: capture.root.clone(),
                field: "view store".into(),
                problem: format!("{error}; give another capacity"),
            })?;
        let cache = Cache::with_options(options_of_cache, Bytes, Hasher::default(), Lifecycle::default());
        let shared = Arc::new(Shared { capture: capture.clone(), margin: options.margin, cache });
        Ok(ViewStore { shared, pool })
    }

    /// The view of a camera and a frame (indices), decoded now unless it is cached or being decoded. Blocks, and must
    /// therefore not be called from rayon tasks.
    ///
    /// # Errors
    /// As in [`Capture::load_view`].
    pub fn get(&self, camera: usize, frame: usize) -> Result<Arc<CroppedView>, CaptureError> {
        let pair = (camera, frame);
        self.shared.cache.get_or_insert_with(&pair, || self.shared.load(pair))
    }

    /// Decodes a view in the background. A failure occurs again in [`ViewStore::get`], which returns the error.
    pub fn prefetch(&self, camera: usize, frame: usize) {
        let pair = (camera, frame);
        if self.shared.cache.peek(&pair).is_none() {
            let shared = self.shared.clone();
            self.pool.spawn(move || match shared.without_waiting(pair) {
                GuardResult::Guard(guard) => {
                    if let Ok(view) = shared.load(pair) {
                        // A view that is too large is not cached.
                        let _ = guard.insert(view);
                    }
                }
                GuardResult::Value(_) | GuardResult::Timeout => {}
            });
        }
    }

    /// Passes each view to a function, on all threads of the store; the results are in the order of the pairs (camera,
    /// frame).
    ///
    /// # Errors
    /// One of the errors of [`Capture::load_view`].
    pub fn map<T: Send>(
        &self,
        pairs: &[(usize, usize)],
        each: impl Fn(&CroppedView) -> T + Sync,
    ) -> Result<Vec<T>, CaptureError> {
        use rayon::prelude::*;
        let view = |pair: &Pair| match self.shared.without_waiting(*pair) {
            GuardResult::Value(view) => Ok(view),
            GuardResult::Guard(guard) => {
                let view = self.shared.load(*pair)?;
                let _ = guard.insert(view.clone());
                Ok(view)
            }
            GuardResult::Timeout => self.shared.load(*pair),
        };
        self.pool.install(|| pairs.par_iter().map(|pair| Ok(each(&*view(pair)?))).collect())
    }

    /// Number of bytes cached now.
    pub fn kept_bytes(&self) -> u64 {
        self.shared.cache.weight()
    }
}

impl Shared {
    fn load(&self, (camera, frame): Pair) -> Result<Arc<CroppedView>, CaptureError> {
        let view = self.capture.load_view(camera, frame)?;
        let camera = self.capture.camera_and_frame(camera, frame)?.0;
        Ok(Arc::new(view.cropped(camera, self.margin)))
    }

    /// The cached view, or the task to decode it, or neither while another thread decodes it. A thread of the pool must
    /// not wait: while it decodes, it may start another task, which may be the one for the same view.
    fn without_waiting(&self, pair: Pair) -> GuardResult<'_, Pair, Arc<CroppedView>, Bytes, Hasher, Lifecycle> {
        self.cache.get_value_or_guard(&pair, Some(Duration::ZERO))
    }
}
