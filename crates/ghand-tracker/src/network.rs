//! Runs a neural network from a TensorFlow Lite file, on the host, in f32.
//!
//! Knows the operators of MediaPipe's palm and hand landmark networks, and refuses others. The file is read and checked
//! once ([`graph`]); what can be computed beforehand, such as weights in half floats, is. [`convolution`] has the two
//! operators that take the time, [`operators`] the others. The same input gives the same bits on the same machine.

mod convolution;
mod flatbuffer;
mod graph;
mod operators;

use self::graph::Graph;
use crate::TrackerError;

/// A network, ready to run.
pub struct Network {
    graph: Graph,
}

impl Network {
    /// Reads a network with one input from the bytes of a `.tflite` file.
    ///
    /// # Errors
    /// If the bytes are not such a file, contradict themselves, have an unknown operator or need too much work.
    pub fn from_tflite(bytes: &[u8]) -> Result<Network, TrackerError> {
        Ok(Network { graph: graph::read(bytes)? })
    }

    /// How many numbers the input has: rows, columns and channels multiplied.
    pub fn input_size(&self) -> usize {
        self.graph.input_size
    }

    /// How many numbers each output has.
    pub fn output_sizes(&self) -> Vec<usize> {
        self.graph.outputs.iter().map(|&output| self.graph.sizes[output]).collect()
    }

    /// The outputs, in the file's order, for an input by rows, columns and channels.
    ///
    /// # Errors
    /// If the input has another size than [`Network::input_size`].
    pub fn run(&self, input: &[f32]) -> Result<Vec<Vec<f32>>, TrackerError> {
        let graph = &self.graph;
        if input.len() != graph.input_size {
            return Err(TrackerError::Input { expected: graph.input_size, got: input.len() });
        }
        let mut tensors: Vec<Vec<f32>> = vec![Vec::new(); graph.sizes.len()];
        tensors[graph.input] = input.to_vec();
        // Buffers of tensors that nothing reads any more.
        let mut free: Vec<Vec<f32>> = Vec::new();
        for step in &graph.steps {
            let mut output = free.pop().unwrap_or_default();
            output.resize(graph.sizes[step.output], 0.0);
            let inputs: Vec<&[f32]> = step.inputs.iter().map(|&tensor| tensors[tensor].as_slice()).collect();
            step.operator.run(&inputs, &mut output);
            tensors[step.output] = output;
            free.extend(step.last_reads.iter().map(|&tensor| std::mem::take(&mut tensors[tensor])));
        }
        Ok(graph.outputs.iter().map(|&output| tensors[output].clone()).collect())
    }
}
