//! Lets the module be linked on macOS by cargo alone, too.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
