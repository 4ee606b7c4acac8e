//! A folder of pictures with a list of them, `render.json`, so that the pictures of two renders never mix.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

use ghand_files::atomic_file::write_atomically;
use ghand_files::claim::Claim;
use ghand_files::input_file;
use serde::{Deserialize, Serialize};

use crate::format::{Format, StillFormat};
use crate::{Picture, PictureError, Shot};

/// The list of a folder's pictures.
pub const LIST: &str = "render.json";
const FORMAT: &str = "ghand-render";
/// Largest list in bytes: a hundred thousand pictures take about ten MB.
const LARGEST_LIST: u64 = 1 << 28;
/// Prefixes of the names of rendered pictures.
const PREFIXES: [&str; 2] = ["frame-", "view-"];

/// Contents of the list.
#[derive(Debug, Serialize, Deserialize)]
struct List {
    format: String,
    /// Whether the render was completed; if not, some of the pictures are missing.
    complete: bool,
    pictures: Vec<Listed>,
}

/// A picture in the list, and what it shows.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Listed {
    file: String,
    #[serde(flatten)]
    shot: Shot,
}

/// A folder that is being filled with pictures.
pub struct Folder {
    path: PathBuf,
    pictures: Vec<Listed>,
    /// Pictures of an earlier render, to be removed.
    earlier: Vec<String>,
    begun: bool,
    _claim: Claim,
}

impl Folder {
    /// Checks the folder, which need not exist, and claims it; else nothing changes.
    ///
    /// # Errors
    /// An error that names a file that would be overwritten but is not from an earlier render, the problem with the
    /// list, or that another command writes there.
    pub fn new(path: &Path, format: StillFormat, shots: &[Shot]) -> Result<Folder, PictureError> {
        // First, because another command may be writing pictures now.
        let claim = Claim::folder(path)?;
        let most = |number: fn(&Shot) -> Option<usize>| shots.iter().filter_map(number).max().unwrap_or(0);
        let widths = [most(|s| s.frame), most(|s| s.view)].map(|most| most.to_string().len());
        let ending = Format::Still(format).ending();
        let pictures: Vec<Listed> = shots
            .iter()
            .map(|shot| Listed { file: format!("{}.{ending}", name(shot, widths)), shot: shot.clone() })
            .collect();
        let earlier = earlier_pictures(path)?;
        let known: HashSet<&str> = earlier.iter().map(String::as_str).collect();
        if let Some(foreign) = pictures.iter().find(|p| !known.contains(p.file.as_str()) && path.join(&p.file).exists())
        {
            let file = path.join(&foreign.file);
            return Err(PictureError::Unsuitable(format!(
                "{}: exists and is not from an earlier render; move it, or choose another folder",
                file.display()
            )));
        }
        Ok(Folder { path: path.into(), pictures, earlier, begun: false, _claim: claim })
    }

    /// Writes picture number `number`; before the first one, removes the pictures of an earlier render.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn add(&mut self, number: usize, picture: Picture) -> Result<(), PictureError> {
        if !self.begun {
            self.begin()?;
            self.begun = true;
        }
        match self.pictures.get(number) {
            Some(listed) => picture.write(&self.path.join(&listed.file)),
            None => Ok(()),
        }
    }

    fn begin(&self) -> Result<(), PictureError> {
        std::fs::create_dir_all(&self.path).map_err(PictureError::file(&self.path, "cannot create the folder"))?;
        // Written first, so that after an interruption every existing picture is listed.
        let mut both = self.pictures.clone();
        let planned: HashSet<&str> = self.pictures.iter().map(|p| p.file.as_str()).collect();
        let only_earlier = self.earlier.iter().filter(|file| !planned.contains(file.as_str()));
        both.extend(only_earlier.map(|file| Listed { file: file.clone(), shot: Shot::default() }));
        self.write_list(both, false)?;
        for file in &self.earlier {
            let path = self.path.join(file);
            std::fs::remove_file(&path)
                .map_err(PictureError::file(&path, "cannot remove the picture of an earlier render"))?;
        }
        self.write_list(self.pictures.clone(), false)
    }

    /// Notes in the list that the render is complete; returns how many pictures of an earlier one were removed.
    ///
    /// # Errors
    /// An error that names the list.
    pub fn finish(self) -> Result<usize, PictureError> {
        self.write_list(self.pictures.clone(), true)?;
        Ok(self.earlier.len())
    }

    /// The names of the first and the last picture.
    pub fn ends(&self) -> Option<[&str; 2]> {
        Some([&self.pictures.first()?.file, &self.pictures.last()?.file])
    }

    fn write_list(&self, pictures: Vec<Listed>, complete: bool) -> Result<(), PictureError> {
        let path = self.path.join(LIST);
        let text = serde_json::to_vec_pretty(&List { format: FORMAT.into(), complete, pictures });
        text.map_err(Into::into)
            .and_then(|text| write_atomically(&path, &text))
            .map_err(PictureError::file(&path, "cannot write"))
    }
}

/// The name of a picture without its extension, its numbers with at least this many digits.
fn name(shot: &Shot, [frame_width, view_width]: [usize; 2]) -> String {
    let frame = shot.frame.map(|number| format!("frame-{number:0width$}", width = frame_width.max(4)));
    let view = shot.view.map(|number| format!("view-{number:0width$}", width = view_width.max(2)));
    [frame, view].into_iter().flatten().collect::<Vec<_>>().join("_")
}

/// The pictures of an earlier render that are still in a folder.
fn earlier_pictures(folder: &Path) -> Result<Vec<String>, PictureError> {
    let path = folder.join(LIST);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let unsuitable = |problem: String| {
        let text = format!("{}: {problem}; remove it, or choose another folder", path.display());
        Err(PictureError::Unsuitable(text))
    };
    let unread = PictureError::file(&path, "cannot be read; remove it, or choose another folder");
    let bytes = input_file::read(&path, LARGEST_LIST).map_err(unread)?;
    let list = bytes.and_then(|bytes| serde_json::from_slice::<List>(&bytes).ok()).filter(|list| list.format == FORMAT);
    let Some(list) = list else {
        return unsuitable("is not a list of pictures rendered by ghand".into());
    };
    // They will be removed, so only files named like a picture of a render and directly in the folder count.
    let is_rendered = |file: &str| {
        let mut parts = Path::new(file).components();
        let is_name = matches!((parts.next(), parts.next()), (Some(Component::Normal(name)), None) if name == file);
        let is_picture = matches!(Format::of(Path::new(file)), Some(Format::Still(_)));
        is_name && is_picture && PREFIXES.iter().any(|prefix| file.starts_with(prefix))
    };
    if let Some(other) = list.pictures.iter().find(|p| !is_rendered(&p.file)) {
        return unsuitable(format!("lists {:?}, which is not the name of a rendered picture", other.file));
    }
    let there = |file: &String| folder.join(file).symlink_metadata().is_ok();
    Ok(list.pictures.into_iter().map(|p| p.file).filter(there).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Background;
    use ghand_files::folder_lock::LOCK_FILE;

    fn shots(frames: usize, views: Option<usize>) -> Vec<Shot> {
        let shot = |frame, view| Shot { frame: Some(frame), view, ..Shot::default() };
        (0..frames)
            .flat_map(|frame| match views {
                Some(views) => (0..views).map(|view| shot(frame, Some(view))).collect(),
                None => vec![shot(frame, None)],
            })
            .collect()
    }

    fn fill(path: &Path, format: StillFormat, shots: &[Shot]) -> Result<usize, PictureError> {
        let mut folder = Folder::new(path, format, shots)?;
        for number in 0..shots.len() {
            folder.add(number, Picture::blank([1, 1], Background::Transparent, format))?;
        }
        folder.finish()
    }

    fn listing(path: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            path.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.retain(|name| name != LOCK_FILE);
        names.sort();
        names
    }

    #[test]
    fn names_contain_frame_and_view_and_sort_in_order() {
        let names = |shots: &[Shot]| -> Vec<String> {
            Folder::new(Path::new("none"), StillFormat::Png, shots)
                .unwrap()
                .pictures
                .into_iter()
                .map(|p| p.file)
                .collect()
        };
        assert_eq!(names(&shots(2, None)), ["frame-0000.png", "frame-0001.png"]);
        assert_eq!(names(&shots(2, Some(2)))[1..3], ["frame-0000_view-01.png", "frame-0001_view-00.png"]);
        let view = Shot { view: Some(3), ..Shot::default() };
        assert_eq!(names(&[view]), ["view-03.png"]);
        for many in [shots(10_001, None), shots(1, Some(101))] {
            let names = names(&many);
            assert!(names.is_sorted(), "{names:?}");
        }
    }

    #[test]
    fn a_render_replaces_only_the_pictures_of_the_previous_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b");
        assert_eq!(fill(&path, StillFormat::Png, &shots(3, None)).unwrap(), 0);
        std::fs::write(path.join("frame-0009.png"), b"mine").unwrap();
        std::fs::write(path.join("notes.txt"), b"mine").unwrap();
        std::fs::remove_file(path.join("frame-0001.png")).unwrap();
        assert_eq!(fill(&path, StillFormat::Exr, &shots(1, Some(2))).unwrap(), 2);
        let expected =
            ["frame-0000_view-00.exr", "frame-0000_view-01.exr", "frame-0009.png", "notes.txt", "render.json"];
        assert_eq!(listing(&path), expected);
        // The same names again.
        assert_eq!(fill(&path, StillFormat::Exr, &shots(1, Some(2))).unwrap(), 2);
        assert_eq!(listing(&path), expected);
    }

    #[test]
    fn the_pictures_of_an_interrupted_render_are_replaced_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        fill(path, StillFormat::Png, &shots(2, Some(1))).unwrap();
        let mut cut = Folder::new(path, StillFormat::Png, &shots(5, None)).unwrap();
        cut.add(0, Picture::bytes([1, 1], Background::Transparent)).unwrap();
        cut.add(1, Picture::bytes([1, 1], Background::Transparent)).unwrap();
        assert_eq!(listing(path), ["frame-0000.png", "frame-0001.png", "render.json"]);
        assert!(std::fs::read_to_string(path.join(LIST)).unwrap().contains("\"complete\": false"));
        drop(cut);
        assert_eq!(fill(path, StillFormat::Png, &shots(1, Some(1))).unwrap(), 2);
        assert_eq!(listing(path), ["frame-0000_view-00.png", "render.json"]);
        assert!(std::fs::read_to_string(path.join(LIST)).unwrap().contains("\"complete\": true"));
    }

    #[test]
    fn other_files_are_not_overwritten_and_foreign_lists_remove_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        std::fs::write(path.join("frame-0001.png"), b"mine").unwrap();
        let error = fill(path, StillFormat::Png, &shots(2, None)).unwrap_err().to_string();
        assert!(error.contains("frame-0001.png: exists"), "{error}");
        let inside = path.join("inside");
        std::fs::create_dir(&inside).unwrap();
        for file in ["../frame-0001.png", "/frame-0001.png", "frame-1/../../frame-0001.png", "notes.txt", "frame-1.txt"]
        {
            let list = format!(r#"{{"format":"ghand-render","complete":true,"pictures":[{{"file":"{file}"}}]}}"#);
            std::fs::write(inside.join(LIST), list).unwrap();
            let error = fill(&inside, StillFormat::Png, &shots(2, None)).unwrap_err().to_string();
            assert!(error.contains(LIST) && error.contains(file), "{error}");
        }
        for list in ["{}", "", r#"{"format":"other","complete":true,"pictures":[]}"#] {
            std::fs::write(inside.join(LIST), list).unwrap();
            let error = fill(&inside, StillFormat::Png, &shots(2, None)).unwrap_err().to_string();
            assert!(error.contains(LIST), "{error}");
        }
        assert_eq!(std::fs::read(path.join("frame-0001.png")).unwrap(), b"mine");
        assert_eq!(listing(&inside), [LIST]);
    }
}
