//! The formats of `ghand export`, by the ending of the file.

use std::path::{Path, PathBuf};

use anyhow::bail;

/// A format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportFormat {
    /// A rigged mesh.
    Glb,
    /// Gaussians, as trainers of 3D Gaussian Splatting write them.
    Ply,
    /// Gaussians, compressed.
    Spz,
    /// A page with the player.
    Html,
}

impl ExportFormat {
    const ALL: [(&'static str, ExportFormat); 4] = [
        ("glb", ExportFormat::Glb),
        ("ply", ExportFormat::Ply),
        ("spz", ExportFormat::Spz),
        ("html", ExportFormat::Html),
    ];

    /// The format of a file.
    ///
    /// # Errors
    /// One sentence that lists the endings.
    pub fn of(path: &Path) -> anyhow::Result<ExportFormat> {
        let ending = path.extension().unwrap_or_default();
        match ExportFormat::ALL.iter().find(|(own, _)| ending.eq_ignore_ascii_case(own)) {
            Some((_, format)) => Ok(*format),
            None => {
                let endings: Vec<String> = ExportFormat::ALL.iter().map(|(own, _)| format!(".{own}")).collect();
                bail!("--out {}: must end in one of {}", path.display(), endings.join(", "))
            }
        }
    }
}

/// The file of a frame of a motion: `wave.ply` becomes `wave-0012.ply`.
pub fn numbered(path: &Path, frame: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{frame:04}.{ending}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_says_the_format_and_frames_are_numbered_before_it() {
        assert_eq!(ExportFormat::of(Path::new("a/b.GLB")).unwrap(), ExportFormat::Glb);
        assert_eq!(ExportFormat::of(Path::new("b.c.spz")).unwrap(), ExportFormat::Spz);
        for other in ["hand.obj", "hand", ".ply"] {
            let message = ExportFormat::of(Path::new(other)).unwrap_err().to_string();
            assert!(message.contains(other) && message.contains(".glb, .ply, .spz, .html"), "{message}");
        }
        assert_eq!(numbered(Path::new("a/wave.1.PLY"), 7), Path::new("a/wave.1-0007.PLY"));
    }
}
