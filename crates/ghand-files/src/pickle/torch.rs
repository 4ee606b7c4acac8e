//! Names that PyTorch writes into pickles.

use super::Class;
use crate::npz::{ElementKind, ElementType};

/// The class or function of that name, if it is one of PyTorch's with plain numbers.
pub(super) fn class(module: &str, name: &str) -> Option<Class> {
    Some(match (module, name) {
        ("torch._utils", "_rebuild_tensor" | "_rebuild_tensor_v2" | "_rebuild_tensor_v3") => Class::Tensor,
        ("torch._utils", "_rebuild_parameter" | "_rebuild_parameter_with_state") => Class::Parameter,
        ("torch._tensor", "_rebuild_from_type_v2") => Class::TensorOfType,
        ("torch.storage", "_load_from_bytes") => Class::StorageFromBytes,
        ("torch.storage", "UntypedStorage") => Class::Storage(element_type("uint8")?),
        ("torch", "Size") => Class::Size,
        ("torch", "device" | "Tensor" | "strided" | "sparse_coo" | "sparse_csr" | "jagged")
        | ("torch", "per_tensor_affine" | "per_channel_affine" | "per_channel_affine_float_qparams")
        | ("torch.nn.parameter", "Parameter" | "Buffer")
        | ("torch.serialization", "_get_layout") => Class::Marker,
        ("torch" | "torch.cuda", _) => match name.strip_suffix("Storage") {
            Some(kind) => Class::Storage(element_type(of_storage(kind)?)?),
            None => Class::Numbers(element_type(name)?),
        },
        _ => return None,
    })
}

/// A part of PyTorch without plain numbers, with a remedy.
pub(super) fn without_numbers(module: &str, name: &str) -> Option<&'static str> {
    const SPARSE: &str = "is a sparse or nested tensor; save tensor.to_dense() instead";
    const COMPLEX: &str = "is a tensor of complex numbers; save its real part (tensor.real.contiguous())";
    match (module, name) {
        ("torch._utils", "_rebuild_qtensor") => Some("is a quantised tensor; save tensor.dequantize() instead"),
        ("torch._utils", "_rebuild_sparse_tensor" | "_rebuild_sparse_csr_tensor" | "_rebuild_nested_tensor") => {
            Some(SPARSE)
        }
        ("torch._utils", "_rebuild_meta_tensor_no_storage") => {
            Some("is a tensor of the meta device, which has no numbers; save it on the device cpu")
        }
        ("torch._utils", "_rebuild_device_tensor_from_numpy" | "_rebuild_device_tensor_from_cpu_tensor") => {
            Some("is a tensor of an uncommon device; save tensor.cpu() instead")
        }
        ("torch", "ComplexFloatStorage" | "ComplexDoubleStorage" | "ComplexHalfStorage")
        | ("torch", "complex32" | "complex64" | "complex128") => Some(COMPLEX),
        ("torch", _) if name.starts_with('Q') && name.ends_with("Storage") => {
            Some("is a quantised tensor; save tensor.dequantize() instead")
        }
        ("torch", _) if name.starts_with("float8_") => {
            Some("is a tensor of floats of 8 bits; save tensor.float() instead")
        }
        _ => None,
    }
}

fn of_storage(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "Double" => "float64",
        "Float" => "float32",
        "Half" => "float16",
        "BFloat16" => "bfloat16",
        "Long" => "int64",
        "Int" => "int32",
        "Short" => "int16",
        "Char" => "int8",
        "Byte" => "uint8",
        "Bool" => "bool",
        _ => return None,
    })
}

fn element_type(name: &str) -> Option<ElementType> {
    let (kind, size) = match name {
        "float64" => (ElementKind::Float, 8),
        "float32" => (ElementKind::Float, 4),
        "float16" => (ElementKind::Float, 2),
        "bfloat16" => (ElementKind::BrainFloat, 2),
        "int64" => (ElementKind::Signed, 8),
        "int32" => (ElementKind::Signed, 4),
        "int16" => (ElementKind::Signed, 2),
        "int8" => (ElementKind::Signed, 1),
        "uint64" => (ElementKind::Unsigned, 8),
        "uint32" => (ElementKind::Unsigned, 4),
        "uint16" => (ElementKind::Unsigned, 2),
        "uint8" => (ElementKind::Unsigned, 1),
        "bool" => (ElementKind::Bool, 1),
        _ => return None,
    };
    Some(ElementType { kind, size, big_endian: false })
}
