//! Runs a neural network from a TensorFlow Lite file, on the host, in f32.
//!
//! Knows what MediaPipe's palm and hand landmark networks have, and nothing else. The file is read once ([`graph`]); what
//! can be computed beforehand, such as weights in half floats, is. [`convolution`] has the two operators that take the
//! time, [`operators`] the others. The same input gives the same bits on the same machine.

mod convolution;
mod flatbuffer;
mod graph;
mod operators;

use self::graph::Graph;

/// A network, ready to run.
pub struct Network {
    graph: Graph,
}

impl Network {
    /// Reads a network with one input from the bytes of a `.tflite` file.
    pub fn from_tflite(bytes: &[u8]) -> Network {
        Network { graph: graph::read(bytes) }
    }

    /// The outputs, in the file's order, for an input by rows, columns and channels.
    pub fn run(&self, input: &[f32]) -> Vec<Vec<f32>> {
        let graph = &self.graph;
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
        graph.outputs.iter().map(|&output| tensors[output].clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Network;
    use crate::landmarks::NETWORK as LANDMARKS;
    use crate::palms::NETWORK as PALMS;

    /// A smooth made-up picture.
    fn waves(edge: usize) -> Vec<f32> {
        let wave = |y: usize, x: usize, c: usize| 0.5 + 0.5 * (0.05 * x as f64 + 0.03 * y as f64 + c as f64).sin();
        let numbers = (0..edge * edge * 3).map(|k| wave(k / 3 / edge, k / 3 % edge, k % 3) as f32);
        numbers.collect()
    }

    #[test]
    fn outputs_are_those_of_tensorflow_lite() {
        // From `ai_edge_litert` on the same input: output, index, number. Sums differ in their order only.
        let palms = [
            (0, 0, 2.210628),
            (0, 6047, 4.471709),
            (0, 12095, 8.971502),
            (0, 18143, 9.598189),
            (0, 24191, 10.528),
            (0, 30239, 24.985102),
            (0, 36287, -2.901664),
            (1, 0, -8.455997),
            (1, 335, -7.416464),
            (1, 671, -7.388546),
            (1, 1007, -6.905465),
            (1, 1343, -9.823341),
            (1, 1679, -10.271726),
            (1, 2015, -6.901298),
        ];
        let landmarks = [
            (0, 0, 126.221458),
            (0, 10, 123.931595),
            (0, 20, -4.758162),
            (0, 31, 84.660042),
            (0, 41, -1.600633),
            (0, 51, 117.209663),
            (0, 62, 2.547836),
            (1, 0, 0.000182),
            (2, 0, 0.736637),
            (3, 0, 0.017276),
            (3, 10, 0.017093),
            (3, 20, -0.01652),
            (3, 31, -0.061411),
            (3, 41, 0.003861),
            (3, 51, -0.00115),
            (3, 62, 0.050572),
        ];
        for (bytes, edge, expected) in [(PALMS, 192, &palms[..]), (LANDMARKS, 224, &landmarks[..])] {
            let outputs = Network::from_tflite(bytes).run(&waves(edge));
            for &(output, index, expected) in expected {
                let got = f64::from(outputs[output][index]);
                let error = (got - expected).abs();
                assert!(error <= 2e-4 * expected.abs() + 2e-5, "{output}, {index}: {got}, not {expected}");
            }
        }
    }

    #[test]
    fn the_same_input_gives_the_same_bits() {
        let network = Network::from_tflite(LANDMARKS);
        let input = waves(224);
        assert_eq!(network.run(&input), network.run(&input));
    }
}
