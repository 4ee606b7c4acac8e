//! Reads the graph of a TensorFlow Lite file and checks it, so that running it cannot fail.

use half::f16;

use super::convolution::{Convolution, DepthwiseConvolution, Window};
use super::flatbuffer::Table;
use super::operators::{Activation, Operator};
use crate::TrackerError;

/// Most numbers of a tensor: five times the largest of MediaPipe's hand networks.
const LARGEST_TENSOR: usize = 1 << 22;

/// Most numbers of all tensors, and of all weights: 256 MiB each.
const MOST_NUMBERS: usize = 1 << 26;

/// Most multiplications of a run: ten times those of MediaPipe's palm network.
const MOST_WORK: u64 = 8_000_000_000;

/// Most dimensions of a tensor.
const MOST_DIMENSIONS: usize = 6;

/// An operator with what it reads and writes.
pub struct Step {
    pub operator: Operator,
    /// Tensors that earlier steps or the caller wrote.
    pub inputs: Vec<usize>,
    pub output: usize,
    /// Tensors that no later step reads.
    pub last_reads: Vec<usize>,
}

/// A checked network.
pub struct Graph {
    pub steps: Vec<Step>,
    /// How many numbers each tensor has.
    pub sizes: Vec<usize>,
    pub input: usize,
    pub input_size: usize,
    pub outputs: Vec<usize>,
}

/// The numbers of a tensor of the file, as far as they are known before running.
#[derive(Clone)]
enum Numbers {
    Unknown,
    Floats(Vec<f32>),
    Ints(Vec<i32>),
}

#[derive(Clone)]
struct Tensor {
    shape: Vec<usize>,
    numbers: Numbers,
    /// Whether a step before this one, or the caller, has computed it.
    is_computed: bool,
}

fn wrong(text: impl Into<String>) -> TrackerError {
    TrackerError::Network(text.into())
}

/// Reads the file.
///
/// # Errors
/// If it cannot be run.
pub fn read(bytes: &[u8]) -> Result<Graph, TrackerError> {
    let root = Table::root(bytes, b"TFL3")?;
    let [graph] = root.tables(2)?[..] else { return Err(wrong("has not exactly one graph")) };
    let mut reader = Reader { tensors: tensors(&root, &graph)?, copied: 0, work: 0 };
    let [input] = graph.ints(1)?[..] else { return Err(wrong("has not exactly one input")) };
    let input = reader.index(input)?;
    if !matches!(reader.tensors[input].numbers, Numbers::Unknown) {
        return Err(wrong("has an input with numbers"));
    }
    reader.tensors[input].is_computed = true;
    let codes: Vec<i32> = root.tables(1)?.iter().map(operator_code).collect::<Result<_, _>>()?;
    let mut steps = Vec::new();
    for table in graph.tables(3)? {
        let code = usize::try_from(table.int(0, 0)?).ok().and_then(|index| codes.get(index));
        let code = *code.ok_or_else(|| wrong("has an operator without a code"))?;
        steps.extend(reader.step(code, &table)?);
    }
    let outputs = graph.ints(2)?.into_iter().map(|output| reader.index(output)).collect::<Result<Vec<_>, _>>()?;
    if outputs.is_empty() || outputs.iter().any(|&output| !reader.tensors[output].is_computed) {
        return Err(wrong("has an output that no operator computes"));
    }
    find_last_reads(&mut steps, reader.tensors.len(), &outputs);
    let sizes: Vec<usize> = reader.tensors.iter().map(|tensor| tensor.shape.iter().product()).collect();
    let input_size = sizes[input];
    Ok(Graph { steps, sizes, input, input_size, outputs })
}

/// The newer of the two fields that may have it.
fn operator_code(table: &Table) -> Result<i32, TrackerError> {
    Ok(table.int(3, 0)?.max(i32::from(table.byte(0)?)))
}

fn tensors(root: &Table, graph: &Table) -> Result<Vec<Tensor>, TrackerError> {
    let buffers = root.tables(4)?;
    let tensor = |table: Table| {
        let shape: Option<Vec<usize>> =
            table.ints(0)?.iter().map(|&n| usize::try_from(n).ok().filter(|&n| n > 0)).collect();
        let shape =
            shape.filter(|shape| shape.len() <= MOST_DIMENSIONS).ok_or_else(|| wrong("has a tensor without size"))?;
        let size = shape.iter().try_fold(1_usize, |size, n| size.checked_mul(*n)).filter(|&n| n <= LARGEST_TENSOR);
        let size = size.ok_or_else(|| wrong(format!("has a tensor of more than {LARGEST_TENSOR} numbers")))?;
        let buffer = usize::try_from(table.int(2, 0)?).ok().and_then(|buffer| buffers.get(buffer));
        let data = buffer.ok_or_else(|| wrong("has a tensor without a buffer"))?.vector(0, 1)?;
        let numbers = match (data, table.byte(1)?) {
            ([], _) => Numbers::Unknown,
            (data, 0) => Numbers::Floats(data.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect()),
            (data, 1) => Numbers::Floats(data.as_chunks().0.iter().map(|b| f16::from_le_bytes(*b).to_f32()).collect()),
            (data, 2) => Numbers::Ints(data.as_chunks().0.iter().map(|b| i32::from_le_bytes(*b)).collect()),
            (_, other) => return Err(wrong(format!("has numbers of the unknown type {other}"))),
        };
        let got = match &numbers {
            Numbers::Unknown => size,
            Numbers::Floats(numbers) => numbers.len(),
            Numbers::Ints(numbers) => numbers.len(),
        };
        if got != size {
            return Err(wrong(format!("has a tensor of {size} numbers with {got} of them")));
        }
        Ok(Tensor { shape, numbers, is_computed: false })
    };
    let mut total = 0;
    let mut tensors = Vec::new();
    for table in graph.tables(0)? {
        let tensor = tensor(table)?;
        total += tensor.shape.iter().product::<usize>();
        if total > MOST_NUMBERS {
            return Err(wrong(format!("has more than {MOST_NUMBERS} numbers")));
        }
        tensors.push(tensor);
    }
    Ok(tensors)
}

fn find_last_reads(steps: &mut [Step], tensors: usize, outputs: &[usize]) {
    let mut is_read_later = vec![false; tensors];
    for &output in outputs {
        is_read_later[output] = true;
    }
    for step in steps.iter_mut().rev() {
        for source in &step.inputs {
            if !std::mem::replace(&mut is_read_later[*source], true) {
                step.last_reads.push(*source);
            }
        }
    }
}

struct Reader {
    tensors: Vec<Tensor>,
    /// Numbers of weights so far.
    copied: usize,
    /// Multiplications so far.
    work: u64,
}

impl Reader {
    fn index(&self, number: i32) -> Result<usize, TrackerError> {
        let index = usize::try_from(number).ok().filter(|&index| index < self.tensors.len());
        index.ok_or_else(|| wrong("names a tensor that it lacks"))
    }

    /// A step, or `None` for what is computed here.
    fn step(&mut self, code: i32, table: &Table) -> Result<Option<Step>, TrackerError> {
        let inputs = table.ints(1)?.into_iter().map(|input| self.index(input)).collect::<Result<Vec<_>, _>>()?;
        let [output] = table.ints(2)?[..] else { return Err(wrong("has an operator with several outputs")) };
        let output = self.index(output)?;
        if self.tensors[output].is_computed || !matches!(self.tensors[output].numbers, Numbers::Unknown) {
            return Err(wrong("computes a tensor twice"));
        }
        if code == 6 {
            let numbers = self.copy(&inputs, 0)?;
            if numbers.len() != self.tensors[output].shape.iter().product() {
                return Err(wrong("converts weights to another size"));
            }
            self.tensors[output].numbers = Numbers::Floats(numbers);
            return Ok(None);
        }
        let (operator, read) = self.operator(code, table, &inputs, output)?;
        let sources = inputs.get(..read).ok_or_else(|| wrong("has an operator with too few inputs"))?;
        if sources.iter().any(|&input| !self.tensors[input].is_computed) {
            return Err(wrong("reads a tensor before it is computed"));
        }
        self.add_work(self.tensors[output].shape.iter().product(), 1)?;
        self.tensors[output].is_computed = true;
        Ok(Some(Step { operator, inputs: sources.to_vec(), output, last_reads: Vec::new() }))
    }

    /// The operator with what it needs, and how many of its inputs it reads while it runs.
    fn operator(
        &mut self,
        code: i32,
        table: &Table,
        inputs: &[usize],
        output: usize,
    ) -> Result<(Operator, usize), TrackerError> {
        let to = self.tensors[output].shape.clone();
        let from = self.shape(inputs, 0)?.to_vec();
        let size = |shape: &[usize]| shape.iter().product::<usize>();
        match code {
            0 if from == to && self.shape(inputs, 1)? == to => Ok((Operator::Add(activation(&table.table(4)?, 0)?), 2)),
            2 => self.concatenation(table, inputs, &to),
            3 => Ok((Operator::Convolution(self.convolution(&table.table(4)?, inputs, picture(&from)?, &to)?), 1)),
            4 => {
                let convolution = self.depthwise_convolution(&table.table(4)?, inputs, picture(&from)?, &to)?;
                Ok((Operator::DepthwiseConvolution(convolution), 1))
            }
            9 => {
                let weights = self.copy(inputs, 1)?;
                let bias = self.copy(inputs, 2)?;
                if weights.len() != size(&from) * size(&to) || bias.len() != size(&to) {
                    return Err(wrong("has a matrix of another size"));
                }
                self.add_work(weights.len(), 1)?;
                Ok((Operator::FullyConnected { weights, bias, activation: activation(&table.table(4)?, 0)? }, 1))
            }
            14 if from == to => Ok((Operator::Logistic, 1)),
            17 => {
                let options = table.table(4)?;
                let [rows, columns, channels] = picture(&from)?;
                let window = window(&options, [rows, columns], [number(&options, 4)?, number(&options, 3)?])?;
                check_picture(&to, [window.output[0], window.output[1], channels])?;
                self.add_work(size(&to), window.size[0] * window.size[1])?;
                Ok((Operator::MaxPool { window, channels, activation: activation(&options, 5)? }, 1))
            }
            22 if size(&from) == size(&to) => Ok((Operator::Copy, 1)),
            23 => {
                let options = table.table(4)?;
                if options.byte(2)? != 0 || options.byte(3)? == 0 {
                    return Err(wrong("resizes a picture by its corners, which is unknown here"));
                }
                let [rows, columns, channels] = picture(&from)?;
                let [new_rows, new_columns, _] = picture(&to)?;
                check_picture(&to, [new_rows, new_columns, channels])?;
                Ok((Operator::ResizeBilinear { from: [rows, columns], to: [new_rows, new_columns], channels }, 1))
            }
            34 => {
                let [rows, columns, channels] = picture(&from)?;
                let padding = match self.ints(inputs, 1)? {
                    [0, 0, 0, 0, 0, 0, before, after] => [*before, *after].map(|n| usize::try_from(n).ok()),
                    _ => [None; 2],
                };
                let [Some(before), Some(after)] = padding else { return Err(wrong("pads more than channels")) };
                check_picture(&to, [rows, columns, channels.saturating_add(before).saturating_add(after)])?;
                Ok((Operator::PadChannels { channels, padding: [before, after] }, 1))
            }
            40 => {
                let [_, _, channels] = picture(&from)?;
                if self.ints(inputs, 1)? != [1, 2] || size(&to) != channels {
                    return Err(wrong("takes a mean over more than rows and columns"));
                }
                Ok((Operator::Mean { channels }, 1))
            }
            54 if from == to => {
                let slopes = self.copy(inputs, 1)?;
                if from.last() != Some(&slopes.len()) {
                    return Err(wrong("has slopes for another number of channels"));
                }
                Ok((Operator::Prelu { slopes }, 1))
            }
            0 | 14 | 22 | 54 => Err(wrong("has an operator whose sizes differ")),
            other => Err(wrong(format!("has an operator that is unknown here (code {other})"))),
        }
    }

    fn concatenation(&self, table: &Table, inputs: &[usize], to: &[usize]) -> Result<(Operator, usize), TrackerError> {
        let options = table.table(4)?;
        let axis = usize::try_from(options.int(0, 0)?).ok().filter(|&axis| axis < to.len());
        let axis = axis.ok_or_else(|| wrong("joins tensors along an axis that they lack"))?;
        let mut length = 0;
        let mut runs = Vec::new();
        for &input in inputs {
            let from = &self.tensors[input].shape;
            if from.len() != to.len() || (0..to.len()).any(|k| k != axis && from[k] != to[k]) {
                return Err(wrong("joins tensors whose sizes differ"));
            }
            length += from[axis];
            runs.push(from[axis..].iter().product());
        }
        if length != to[axis] || activation(&options, 1)? != Activation::None {
            return Err(wrong("joins tensors whose sizes differ"));
        }
        Ok((Operator::Concatenate { runs }, inputs.len()))
    }

    fn convolution(
        &mut self,
        options: &Table,
        inputs: &[usize],
        [rows, columns, channels]: [usize; 3],
        to: &[usize],
    ) -> Result<Convolution, TrackerError> {
        let [filters, height, width, depth] = self.shape(inputs, 1)?[..] else {
            return Err(wrong("has a convolution without a window"));
        };
        if depth != channels || options.int(4, 1)? != 1 || options.int(5, 1)? != 1 {
            return Err(wrong("has a convolution in groups or with gaps, which is unknown here"));
        }
        let window = window(options, [rows, columns], [height, width])?;
        check_picture(to, [window.output[0], window.output[1], filters])?;
        let bias = self.copy(inputs, 2)?;
        let by_filter = self.copy(inputs, 1)?;
        if bias.len() != filters {
            return Err(wrong("has a convolution with another number of biases"));
        }
        let depth = height * width * channels;
        let mut weights = vec![0.0; by_filter.len()];
        for (filter, from) in by_filter.chunks_exact(depth).enumerate() {
            for (k, weight) in from.iter().enumerate() {
                weights[k * filters + filter] = *weight;
            }
        }
        self.add_work(to.iter().product(), depth)?;
        Ok(Convolution { window, channels, filters, weights, bias, activation: activation(options, 3)? })
    }

    fn depthwise_convolution(
        &mut self,
        options: &Table,
        inputs: &[usize],
        [rows, columns, channels]: [usize; 3],
        to: &[usize],
    ) -> Result<DepthwiseConvolution, TrackerError> {
        let [1, height, width, depth] = self.shape(inputs, 1)?[..] else {
            return Err(wrong("has a convolution without a window"));
        };
        if depth != channels || options.int(5, 1)? != 1 || options.int(6, 1)? != 1 {
            return Err(wrong("has a convolution with multiplied channels or gaps, which is unknown here"));
        }
        let window = window(options, [rows, columns], [height, width])?;
        check_picture(to, [window.output[0], window.output[1], channels])?;
        let weights = self.copy(inputs, 1)?;
        let bias = self.copy(inputs, 2)?;
        if bias.len() != channels {
            return Err(wrong("has a convolution with another number of biases"));
        }
        self.add_work(to.iter().product(), height * width)?;
        Ok(DepthwiseConvolution { window, channels, weights, bias, activation: activation(options, 4)? })
    }

    fn add_work(&mut self, outputs: usize, multiplications: usize) -> Result<(), TrackerError> {
        self.work = self.work.saturating_add((outputs as u64).saturating_mul(multiplications as u64));
        if self.work > MOST_WORK {
            return Err(wrong(format!("needs more than {MOST_WORK} multiplications")));
        }
        Ok(())
    }

    fn tensor(&self, inputs: &[usize], which: usize) -> Result<&Tensor, TrackerError> {
        let input = inputs.get(which).ok_or_else(|| wrong("has an operator with too few inputs"))?;
        Ok(&self.tensors[*input])
    }

    fn shape(&self, inputs: &[usize], which: usize) -> Result<&[usize], TrackerError> {
        Ok(&self.tensor(inputs, which)?.shape)
    }

    fn floats(&self, inputs: &[usize], which: usize) -> Result<&[f32], TrackerError> {
        match &self.tensor(inputs, which)?.numbers {
            Numbers::Floats(numbers) => Ok(numbers),
            _ => Err(wrong("has an operator whose weights are missing")),
        }
    }

    /// Weights, counted: a small file may name the same ones many times.
    fn copy(&mut self, inputs: &[usize], which: usize) -> Result<Vec<f32>, TrackerError> {
        let numbers = self.floats(inputs, which)?.to_vec();
        self.copied += numbers.len();
        if self.copied > MOST_NUMBERS {
            return Err(wrong(format!("has more than {MOST_NUMBERS} weights")));
        }
        Ok(numbers)
    }

    fn ints(&self, inputs: &[usize], which: usize) -> Result<&[i32], TrackerError> {
        match &self.tensor(inputs, which)?.numbers {
            Numbers::Ints(numbers) => Ok(numbers),
            _ => Err(wrong("has an operator whose sizes are missing")),
        }
    }
}

/// A window with the strides and the padding of the options.
fn window(options: &Table, input: [usize; 2], size: [usize; 2]) -> Result<Window, TrackerError> {
    let stride = [number(options, 2)?, number(options, 1)?];
    if stride.contains(&0) || size.contains(&0) {
        return Err(wrong("has a window without size"));
    }
    match options.byte(0)? {
        0 => Ok(Window::padded(input, size, stride)),
        1 => Window::inside(input, size, stride).ok_or_else(|| wrong("has a window larger than its picture")),
        _ => Err(wrong("has a window with unknown padding")),
    }
}

/// A size or a stride, at most 4096.
fn number(options: &Table, index: usize) -> Result<usize, TrackerError> {
    let number = usize::try_from(options.int(index, 0)?).ok().filter(|&number| number <= 4096);
    number.ok_or_else(|| wrong("has a window of a wrong size"))
}

fn activation(options: &Table, index: usize) -> Result<Activation, TrackerError> {
    match options.byte(index)? {
        0 => Ok(Activation::None),
        1 => Ok(Activation::Relu),
        3 => Ok(Activation::Relu6),
        other => Err(wrong(format!("has an activation that is unknown here (code {other})"))),
    }
}

/// Rows, columns and channels of a single picture.
fn picture(shape: &[usize]) -> Result<[usize; 3], TrackerError> {
    match *shape {
        [1, rows, columns, channels] => Ok([rows, columns, channels]),
        _ => Err(wrong("has an operator on pictures whose input is not one picture")),
    }
}

fn check_picture(shape: &[usize], expected: [usize; 3]) -> Result<(), TrackerError> {
    if picture(shape)? == expected { Ok(()) } else { Err(wrong("has an operator whose output has another size")) }
}
