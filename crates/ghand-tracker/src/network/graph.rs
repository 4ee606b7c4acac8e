//! Reads the graph of a TensorFlow Lite file.
//!
//! Only the two files that come with this crate are read, so that nothing is checked: anything that they do not have,
//! such as another operator, is a bug and panics.

use half::f16;

use super::convolution::{Convolution, DepthwiseConvolution, Window};
use super::flatbuffer::Table;
use super::operators::{Activation, Operator};

/// An operator with what it reads and writes.
pub struct Step {
    pub operator: Operator,
    /// Tensors that earlier steps or the caller wrote.
    pub inputs: Vec<usize>,
    pub output: usize,
    /// Tensors that no later step reads.
    pub last_reads: Vec<usize>,
}

/// A network.
pub struct Graph {
    pub steps: Vec<Step>,
    /// How many numbers each tensor has.
    pub sizes: Vec<usize>,
    pub input: usize,
    pub outputs: Vec<usize>,
}

/// A tensor of the file.
struct Tensor {
    shape: Vec<usize>,
    /// Those that are known before running.
    weights: Vec<f32>,
}

/// Reads the file.
pub fn read(bytes: &[u8]) -> Graph {
    let root = Table::root(bytes);
    let graph = root.tables(2)[0];
    let mut reader = Reader { tensors: tensors(&root, &graph) };
    let codes: Vec<usize> = root.tables(1).iter().map(operator_code).collect();
    let mut steps: Vec<Step> =
        graph.tables(3).iter().filter_map(|table| reader.step(codes[table.number(0)], table)).collect();
    let outputs = graph.numbers(2);
    find_last_reads(&mut steps, reader.tensors.len(), &outputs);
    let sizes = reader.tensors.iter().map(|tensor| size(&tensor.shape)).collect();
    Graph { steps, sizes, input: graph.numbers(1)[0], outputs }
}

/// The newer of the two fields that may have it.
fn operator_code(table: &Table) -> usize {
    table.number(3).max(usize::from(table.byte(0)))
}

fn tensors(root: &Table, graph: &Table) -> Vec<Tensor> {
    let buffers = root.tables(4);
    let tensor = |table: &Table| {
        // Integers are sizes, which follow from the shapes, too.
        let is_half_float = table.byte(1) == 1;
        let data = if is_half_float { buffers[table.number(2)].vector(0, 1) } else { &[] };
        let weights = data.as_chunks().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect();
        Tensor { shape: table.numbers(0), weights }
    };
    graph.tables(0).iter().map(tensor).collect()
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
}

impl Reader {
    /// A step, or `None` for what is computed here.
    fn step(&mut self, code: usize, table: &Table) -> Option<Step> {
        let inputs = table.numbers(1);
        let output = table.numbers(2)[0];
        // From half floats to floats, which they are already.
        if code == 6 {
            self.tensors[output].weights = self.weights(inputs[0]);
            return None;
        }
        let operator = self.operator(code, table, &inputs, output);
        let read = match operator {
            Operator::Add => 2,
            Operator::Concatenate { .. } => inputs.len(),
            _ => 1,
        };
        Some(Step { operator, inputs: inputs[..read].to_vec(), output, last_reads: Vec::new() })
    }

    /// The operator with what it needs.
    fn operator(&self, code: usize, table: &Table, inputs: &[usize], output: usize) -> Operator {
        let from = self.shape(inputs[0]);
        let to = self.shape(output);
        let options = || table.table(4);
        match code {
            0 => Operator::Add,
            2 => {
                let axis = options().number(0);
                let run = |&input: &usize| size(&self.shape(input)[axis..]);
                Operator::Concatenate { runs: inputs.iter().map(run).collect() }
            }
            3 => Operator::Convolution(self.convolution(&options(), inputs)),
            4 => Operator::DepthwiseConvolution(self.depthwise_convolution(&options(), inputs)),
            9 => Operator::FullyConnected { weights: self.weights(inputs[1]), bias: self.weights(inputs[2]) },
            14 => Operator::Logistic,
            17 => {
                let [rows, columns, channels] = picture(from);
                let options = options();
                let window = window(&options, [rows, columns], [options.number(4), options.number(3)]);
                Operator::MaxPool { window, channels }
            }
            22 => Operator::Copy,
            23 => {
                let [rows, columns, channels] = picture(from);
                let [new_rows, new_columns, _] = picture(to);
                Operator::ResizeBilinear { from: [rows, columns], to: [new_rows, new_columns], channels }
            }
            34 => {
                let [_, _, channels] = picture(from);
                let [_, _, padded] = picture(to);
                Operator::PadChannels { channels, padding: padded - channels }
            }
            40 => Operator::Mean { channels: picture(from)[2] },
            54 => Operator::Prelu { slopes: self.weights(inputs[1]) },
            other => unreachable!("operator {other}"),
        }
    }

    fn convolution(&self, options: &Table, inputs: &[usize]) -> Convolution {
        let [rows, columns, channels] = picture(self.shape(inputs[0]));
        let &[filters, height, width, _] = self.shape(inputs[1]) else {
            unreachable!("a convolution without a window")
        };
        let by_filter = self.weights(inputs[1]);
        let depth = height * width * channels;
        let mut weights = vec![0.0; by_filter.len()];
        for (filter, from) in by_filter.chunks_exact(depth).enumerate() {
            for (k, weight) in from.iter().enumerate() {
                weights[k * filters + filter] = *weight;
            }
        }
        Convolution {
            window: window(options, [rows, columns], [height, width]),
            channels,
            filters,
            weights,
            bias: self.weights(inputs[2]),
            activation: activation(options.byte(3)),
        }
    }

    fn depthwise_convolution(&self, options: &Table, inputs: &[usize]) -> DepthwiseConvolution {
        let [rows, columns, channels] = picture(self.shape(inputs[0]));
        let &[_, height, width, _] = self.shape(inputs[1]) else { unreachable!("a convolution without a window") };
        DepthwiseConvolution {
            window: window(options, [rows, columns], [height, width]),
            channels,
            weights: self.weights(inputs[1]),
            bias: self.weights(inputs[2]),
            activation: activation(options.byte(4)),
        }
    }

    fn shape(&self, tensor: usize) -> &[usize] {
        &self.tensors[tensor].shape
    }

    fn weights(&self, tensor: usize) -> Vec<f32> {
        self.tensors[tensor].weights.clone()
    }
}

fn size(shape: &[usize]) -> usize {
    shape.iter().product()
}

/// A window with the strides of the options.
fn window(options: &Table, input: [usize; 2], size: [usize; 2]) -> Window {
    Window::padded(input, size, [options.number(2), options.number(1)])
}

fn activation(code: u8) -> Activation {
    match code {
        0 => Activation::None,
        3 => Activation::Relu6,
        other => unreachable!("activation {other}"),
    }
}

/// Rows, columns and channels of a picture.
fn picture(shape: &[usize]) -> [usize; 3] {
    [shape[1], shape[2], shape[3]]
}
