//! Writes pickles and `.npz` archives as Python 2.7 with NumPy, chumpy and SciPy wrote them.

use std::io::{Cursor, Write};

/// A value of Python.
#[derive(Clone)]
pub enum Py {
    None,
    Int(i64),
    /// A string of Python 2, which is bytes.
    Str(Vec<u8>),
    Tuple(Vec<Py>),
    List(Vec<Py>),
    Dict(Vec<(Py, Py)>),
    Array(Array),
    /// An instance of a class (module and name) with its state.
    Instance(&'static str, &'static str, Box<Py>),
    /// The result of a function or class (module and name) called with a tuple.
    Call(&'static str, &'static str, Vec<Py>),
}

/// A NumPy array: type code, shape, whether the first index runs fastest, and the bytes in that order.
#[derive(Clone)]
pub struct Array {
    pub code: &'static str,
    pub shape: Vec<usize>,
    pub fortran: bool,
    pub bytes: Vec<u8>,
}

pub fn string(text: &str) -> Py {
    Py::Str(text.as_bytes().to_vec())
}

pub fn dictionary(entries: Vec<(&str, Py)>) -> Py {
    Py::Dict(entries.into_iter().map(|(key, value)| (string(key), value)).collect())
}

/// `values` are row-major; the array is stored in the given order.
pub fn array(code: &'static str, shape: &[usize], fortran: bool, values: &[f64]) -> Array {
    assert_eq!(shape.iter().product::<usize>(), values.len());
    let mut order: Vec<usize> = (0..values.len()).collect();
    if fortran {
        // The index of each element with the first axis as the slowest.
        order.sort_by_cached_key(|&at| {
            let mut rest = at;
            shape.iter().rev().fold(0, |key, n| {
                let index = rest % n;
                rest /= n;
                key * n + index
            })
        });
    }
    let mut bytes = Vec::new();
    for value in order.into_iter().map(|at| values[at]) {
        match code {
            "<f8" => bytes.extend(value.to_le_bytes()),
            ">f8" => bytes.extend(value.to_be_bytes()),
            "<f4" => bytes.extend((value as f32).to_le_bytes()),
            "<i4" => bytes.extend((value as i32).to_le_bytes()),
            "<i8" => bytes.extend((value as i64).to_le_bytes()),
            "|u1" => bytes.push(value as u8),
            "<u4" => bytes.extend((value as u32).to_le_bytes()),
            other => panic!("no writer of {other}"),
        }
    }
    Array { code, shape: shape.to_vec(), fortran, bytes }
}

/// `scipy.sparse.csc_matrix` of rows of `(column, value)`.
pub fn sparse_columns(columns: usize, rows: &[Vec<(u32, f64)>]) -> Py {
    let mut data = vec![];
    let mut indices = vec![];
    let mut starts = vec![0.0];
    for column in 0..columns {
        for (row, entries) in rows.iter().enumerate() {
            for (_, value) in entries.iter().filter(|(at, _)| *at as usize == column) {
                data.push(*value);
                indices.push(row as f64);
            }
        }
        starts.push(data.len() as f64);
    }
    let flat = |code, values: &[f64]| Py::Array(array(code, &[values.len()], false, values));
    let state = dictionary(vec![
        ("_shape", Py::Tuple(vec![Py::Int(rows.len() as i64), Py::Int(columns as i64)])),
        ("maxprint", Py::Int(50)),
        ("indices", flat("<i4", &indices)),
        ("indptr", flat("<i4", &starts)),
        ("data", flat("<f8", &data)),
    ]);
    Py::Instance("scipy.sparse.csc", "csc_matrix", Box::new(state))
}

/// A chumpy array: its state has more than the numbers.
pub fn chumpy(x: Array) -> Py {
    let state = dictionary(vec![
        ("_dirty_vars", Py::Call("__builtin__", "set", vec![Py::List(vec![string("x")])])),
        ("x", Py::Array(x)),
        ("_itr", Py::Int(1 << 40)),
    ]);
    Py::Instance("chumpy.ch", "Ch", Box::new(state))
}

/// `chumpy(x)[:, :, :count]` of an array of three axes.
pub fn chumpy_selection(x: Array, count: usize) -> Py {
    let &[rows, three, all] = x.shape.as_slice() else { panic!("three axes") };
    let picks: Vec<f64> = (0..rows * three * all).filter(|at| at % all < count).map(|at| at as f64).collect();
    let shape = [rows, three, count].map(|n| Py::Int(n as i64));
    let state = dictionary(vec![
        ("a", chumpy(x)),
        ("preferred_shape", Py::Tuple(shape.to_vec())),
        ("idxs", Py::Array(array("<i8", &[picks.len()], false, &picks))),
    ]);
    Py::Instance("chumpy.reordering", "Select", Box::new(state))
}

/// A pickle of protocol 2 as Python 2.7 writes it: every value is memoised, strings are bytes, objects are built from
/// their state.
pub fn pickle(value: &Py) -> Vec<u8> {
    let mut pickler = Pickler { out: vec![0x80, 2], memo: 0 };
    pickler.write(value);
    pickler.out.push(b'.');
    pickler.out
}

struct Pickler {
    out: Vec<u8>,
    memo: u32,
}

impl Pickler {
    fn write(&mut self, value: &Py) {
        match value {
            Py::None => self.out.push(b'N'),
            Py::Int(value) => self.int(*value),
            Py::Str(bytes) => {
                self.str(bytes);
                self.put();
            }
            Py::Tuple(items) => self.tuple(items),
            Py::List(items) => {
                self.out.push(b']');
                self.put();
                self.out.push(b'(');
                items.iter().for_each(|item| self.write(item));
                self.out.push(b'e');
            }
            Py::Dict(entries) => {
                self.out.push(b'}');
                self.put();
                self.out.push(b'(');
                for (key, value) in entries {
                    self.write(key);
                    self.write(value);
                }
                self.out.push(b'u');
            }
            Py::Array(array) => self.array(array),
            Py::Instance(module, name, state) => {
                self.global(module, name);
                self.out.extend(b")\x81");
                self.put();
                self.write(state);
                self.out.push(b'b');
            }
            Py::Call(module, name, args) => {
                self.global(module, name);
                self.tuple(args);
                self.out.push(b'R');
                self.put();
            }
        }
    }

    fn array(&mut self, array: &Array) {
        self.global("numpy.core.multiarray", "_reconstruct");
        self.global("numpy", "ndarray");
        self.tuple(&[Py::Int(0)]);
        self.write(&string("b"));
        self.out.push(0x87);
        self.put();
        self.out.push(b'R');
        self.put();
        // (version, shape, type, order, bytes)
        self.out.push(b'(');
        self.int(1);
        self.tuple(&array.shape.iter().map(|n| Py::Int(*n as i64)).collect::<Vec<_>>());
        let (order, code) = array.code.split_at(1);
        self.global("numpy", "dtype");
        self.tuple(&[string(code), Py::Int(0), Py::Int(1)]);
        self.out.push(b'R');
        self.put();
        self.out.push(b'(');
        self.int(3);
        self.write(&string(order));
        self.out.extend(b"NNN");
        self.int(-1);
        self.int(-1);
        self.int(0);
        self.out.push(b't');
        self.put();
        self.out.push(b'b');
        self.out.push(if array.fortran { 0x88 } else { 0x89 });
        self.str(&array.bytes);
        self.put();
        self.out.push(b't');
        self.put();
        self.out.push(b'b');
    }

    fn tuple(&mut self, items: &[Py]) {
        if items.len() > 3 {
            self.out.push(b'(');
        }
        items.iter().for_each(|item| self.write(item));
        self.out.push(match items.len() {
            0 => b')',
            1 => 0x85,
            2 => 0x86,
            3 => 0x87,
            _ => b't',
        });
        self.put();
    }

    fn int(&mut self, value: i64) {
        if let Ok(value) = u8::try_from(value) {
            self.out.extend([b'K', value]);
        } else if let Ok(value) = u16::try_from(value) {
            self.out.push(b'M');
            self.out.extend(value.to_le_bytes());
        } else if let Ok(value) = i32::try_from(value) {
            self.out.push(b'J');
            self.out.extend(value.to_le_bytes());
        } else {
            self.out.extend([0x8a, 8]);
            self.out.extend(value.to_le_bytes());
        }
    }

    fn str(&mut self, bytes: &[u8]) {
        if let Ok(length) = u8::try_from(bytes.len()) {
            self.out.extend([b'U', length]);
        } else {
            self.out.push(b'T');
            self.out.extend((bytes.len() as u32).to_le_bytes());
        }
        self.out.extend(bytes);
    }

    fn global(&mut self, module: &str, name: &str) {
        self.out.extend(format!("c{module}\n{name}\n").bytes());
        self.put();
    }

    fn put(&mut self) {
        if let Ok(key) = u8::try_from(self.memo) {
            self.out.extend([b'q', key]);
        } else {
            self.out.push(b'r');
            self.out.extend(self.memo.to_le_bytes());
        }
        self.memo += 1;
    }
}

/// An `.npy` file of format version 1; anything but an array becomes an array of one object.
pub fn npy(value: &Py) -> Vec<u8> {
    let (code, fortran, shape, data) = match value {
        Py::Array(array) => (array.code, array.fortran, array.shape.as_slice(), array.bytes.clone()),
        object => {
            // The array of no axes that holds the object.
            let mut pickler = Pickler { out: vec![0x80, 2], memo: 0 };
            pickler.global("numpy.core.multiarray", "_reconstruct");
            pickler.global("numpy", "ndarray");
            pickler.out.extend(b"K\0\x85U\x01b\x87R(K\x01)");
            pickler.global("numpy", "dtype");
            pickler.out.extend(b"U\x02O8K\0K\x01\x87R(K\x03U\x01|NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK?tb\x89](");
            pickler.write(object);
            pickler.out.extend(b"etb.");
            ("|O", false, &[][..], pickler.out)
        }
    };
    let axes: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let order = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{code}', 'fortran_order': {order}, 'shape': ({}), }}", axes.trim_end());
    // The data begin at a multiple of 64 bytes.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header.extend(std::iter::repeat_n(' ', length - header.len() - 1));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(data);
    bytes
}

/// A zip archive of files.
pub fn zip(files: &[(String, Vec<u8>)], deflate: bool) -> Vec<u8> {
    let method = if deflate { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        writer.start_file(name.as_str(), options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}
