//! A Vulkan driver that fails on request.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use ghand_render::Gpu;

use super::run_in;

/// A driver that fails, in its own folder.
pub struct FailingDriver {
    folder: tempfile::TempDir,
    loader: PathBuf,
}

impl FailingDriver {
    /// Builds it; `None` without a C compiler, or if the programs do not use Vulkan's loader.
    pub fn new(gpu: &Gpu) -> Option<FailingDriver> {
        let folder = tempfile::tempdir().unwrap();
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../ghand-app/tests/support/losing_vulkan.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-Wall", "-Werror", "-o"]).arg(folder.path().join("libvulkan.so.1"));
        let built = compiler.arg(source).arg("-ldl").status();
        if !built.is_ok_and(|status| status.success()) {
            println!("skipped: no C compiler `cc`");
            return None;
        }
        // This process has loaded it.
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
        let loader =
            maps.lines().find_map(|line| line.split_whitespace().last().filter(|p| p.contains("/libvulkan.so")));
        let Some(loader) = loader.map(PathBuf::from) else {
            println!("skipped: {} does not use Vulkan's loader", gpu.info.name);
            return None;
        };
        Some(FailingDriver { folder, loader })
    }

    pub fn run(&self, program: &str, folder: &Path, arguments: &[&str], fault: (&str, &str)) -> Output {
        let loader = self.loader.to_str().unwrap();
        let here = self.folder.path().to_str().unwrap();
        run_in(program, folder, arguments, &[("LD_LIBRARY_PATH", here), ("REAL_VULKAN", loader), fault])
    }
}
