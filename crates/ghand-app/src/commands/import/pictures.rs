//! The pictures of an import's page.

use ghand_capture::Capture;
use ghand_capture::inspection::{CaptureInspection, DEFAULT_SAMPLE};
use image::RgbImage;

use super::turntable::strip;
use crate::cli::AdapterArgs;
use crate::commands::inspect::contact_sheet::{SheetView, contact_sheet};

/// Number of views on the sheet.
const SHEET_VIEWS: usize = 8;

/// Pictures of a capture's hand.
#[derive(Debug, Clone)]
pub struct Pictures {
    /// Some images with the hand model over them, or why there are none.
    pub sheet: Result<RgbImage, String>,
    /// The hand from all sides, or why it is not shown.
    pub strip: Result<RgbImage, String>,
    /// The frame in whose pose it is: the first of the sheet, so that both can be compared.
    pub frame: usize,
}

impl Pictures {
    /// Draws them. Without any graphics adapter there is no sheet.
    ///
    /// # Errors
    /// If an image cannot be used, or there is no adapter of the name that is asked for.
    pub fn of(capture: &Capture, adapter: &AdapterArgs) -> anyhow::Result<Pictures> {
        let found = CaptureInspection::of(capture, DEFAULT_SAMPLE)?;
        let views: Vec<SheetView> = (found.examples(SHEET_VIEWS).into_iter())
            .map(|(split, fit)| SheetView { split: split.name.clone(), fit })
            .collect();
        let sheet = match adapter.open_if_any() {
            _ if views.is_empty() => Err("no image could be decoded".into()),
            Ok(Err(error)) => Err(error.to_string()),
            gpu => Ok(gpu??.retry_on_device_loss("the pictures", |gpu| contact_sheet(gpu, capture, &views))?),
        };
        let frame = views.first().map_or(0, |view| view.fit.frame);
        Ok(Pictures { sheet, strip: strip(capture, frame).map_err(|error| error.to_string()), frame })
    }
}
