//! Tensors as PyTorch pickles them: a storage in the format of files before 1.6, inside of a function's arguments.

use ghand_test_support::mano_files::python::Py;

/// A tensor of single precision with one axis.
pub fn tensor(values: &[f64]) -> Py {
    let count = values.len() as i64;
    let storage = Py::Call("torch.storage", "_load_from_bytes", vec![Py::Str(storage(values))]);
    let hooks = Py::Call("collections", "OrderedDict", vec![]);
    let arguments =
        vec![storage, Py::Int(0), Py::Tuple(vec![Py::Int(count)]), Py::Tuple(vec![Py::Int(1)]), Py::Int(0), hooks];
    Py::Call("torch._utils", "_rebuild_tensor_v2", arguments)
}

fn storage(values: &[f64]) -> Vec<u8> {
    // Magic number, version, machine.
    let mut bytes = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.\x80\x02M\xe9\x03.\x80\x02}q\x00(".to_vec();
    bytes.extend(b"X\x10\x00\x00\x00protocol_versionq\x01M\xe9\x03X\r\x00\x00\x00little_endianq\x02\x88");
    bytes
        .extend(b"X\n\x00\x00\x00type_sizesq\x03}q\x04(X\x05\x00\x00\x00shortq\x05K\x02X\x03\x00\x00\x00intq\x06K\x04");
    bytes.extend(b"X\x04\x00\x00\x00longq\x07K\x04uu.");
    // The storage by its key, and the keys.
    bytes.extend(
        b"\x80\x02(X\x07\x00\x00\x00storageq\x00ctorch\nFloatStorage\nq\x01X\x0e\x00\x00\x0094291855087552q\x02",
    );
    bytes.extend(b"X\x03\x00\x00\x00cpuq\x03");
    bytes.extend([b'K', values.len() as u8]);
    bytes.extend(b"Ntq\x04Q.\x80\x02]q\x00X\x0e\x00\x00\x0094291855087552q\x01a.");
    bytes.extend((values.len() as u64).to_le_bytes());
    values.iter().for_each(|value| bytes.extend((*value as f32).to_le_bytes()));
    bytes
}
