//! The three backbones: layers, shapes of their tensors, and the layers whose outputs are compared.

use std::fmt;

use serde::Serialize;

/// A published feature extractor, as in torchvision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Backbone {
    /// AlexNet.
    Alex,
    /// VGG16 without batch normalisation.
    Vgg,
    /// SqueezeNet 1.1.
    Squeeze,
}

impl fmt::Display for Backbone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A convolution with bias, before a ReLU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Conv {
    /// Name of its tensors without `.weight` and `.bias`.
    pub name: String,
    pub inputs: usize,
    pub outputs: usize,
    pub kernel: usize,
    pub stride: usize,
    pub padding: usize,
}

impl Conv {
    /// Shapes of weight and bias.
    pub fn shapes(&self) -> [Vec<usize>; 2] {
        [vec![self.outputs, self.inputs, self.kernel, self.kernel], vec![self.outputs]]
    }
}

/// One layer of a backbone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Layer {
    /// Convolution and ReLU.
    Conv(Conv),
    /// A fire module: a 1x1 convolution, then a 1x1 and a 3x3 one side by side, each with ReLU.
    Fire(Box<[Conv; 3]>),
    /// Maximum over windows, every two pixels. With `ceil`, the last window may reach beyond the edge.
    Pool { kernel: usize, ceil: bool },
    /// The features here are compared.
    Tap { channels: usize },
}

fn conv(index: usize, channels: [usize; 2], kernel: usize, stride: usize, padding: usize) -> Layer {
    let [inputs, outputs] = channels;
    Layer::Conv(Conv { name: format!("features.{index}"), inputs, outputs, kernel, stride, padding })
}

fn conv3(index: usize, inputs: usize, outputs: usize) -> Layer {
    conv(index, [inputs, outputs], 3, 1, 1)
}

fn fire(index: usize, inputs: usize, squeezed: usize, outputs: usize) -> Layer {
    let part = |name: &str, inputs, outputs, kernel| Conv {
        name: format!("features.{index}.{name}"),
        inputs,
        outputs,
        kernel,
        stride: 1,
        padding: kernel / 2,
    };
    Layer::Fire(Box::new([
        part("squeeze", inputs, squeezed, 1),
        part("expand1x1", squeezed, outputs / 2, 1),
        part("expand3x3", squeezed, outputs / 2, 3),
    ]))
}

fn pool(kernel: usize, ceil: bool) -> Layer {
    Layer::Pool { kernel, ceil }
}

fn tap(channels: usize) -> Layer {
    Layer::Tap { channels }
}

impl Backbone {
    /// All backbones.
    pub const ALL: [Backbone; 3] = [Backbone::Alex, Backbone::Vgg, Backbone::Squeeze];

    /// The name that the `lpips` package and the weights' file use.
    pub fn name(self) -> &'static str {
        match self {
            Backbone::Alex => "alex",
            Backbone::Vgg => "vgg",
            Backbone::Squeeze => "squeeze",
        }
    }

    /// Smallest width and height of an image whose features exist up to the last comparison, pixels.
    pub fn smallest_side(self) -> usize {
        let layers = self.layers();
        (1..).find(|side| layers.iter().try_fold(*side, |side, layer| layer.side(side)).is_some()).unwrap_or(1)
    }

    pub(super) fn layers(self) -> Vec<Layer> {
        match self {
            Backbone::Alex => vec![
                conv(0, [3, 64], 11, 4, 2),
                tap(64),
                pool(3, false),
                conv(3, [64, 192], 5, 1, 2),
                tap(192),
                pool(3, false),
                conv3(6, 192, 384),
                tap(384),
                conv3(8, 384, 256),
                tap(256),
                conv3(10, 256, 256),
                tap(256),
            ],
            Backbone::Vgg => vec![
                conv3(0, 3, 64),
                conv3(2, 64, 64),
                tap(64),
                pool(2, false),
                conv3(5, 64, 128),
                conv3(7, 128, 128),
                tap(128),
                pool(2, false),
                conv3(10, 128, 256),
                conv3(12, 256, 256),
                conv3(14, 256, 256),
                tap(256),
                pool(2, false),
                conv3(17, 256, 512),
                conv3(19, 512, 512),
                conv3(21, 512, 512),
                tap(512),
                pool(2, false),
                conv3(24, 512, 512),
                conv3(26, 512, 512),
                conv3(28, 512, 512),
                tap(512),
            ],
            Backbone::Squeeze => vec![
                conv(0, [3, 64], 3, 2, 0),
                tap(64),
                pool(3, true),
                fire(3, 64, 16, 128),
                fire(4, 128, 16, 128),
                tap(128),
                pool(3, true),
                fire(6, 128, 32, 256),
                fire(7, 256, 32, 256),
                tap(256),
                pool(3, true),
                fire(9, 256, 48, 384),
                tap(384),
                fire(10, 384, 48, 384),
                tap(384),
                fire(11, 384, 64, 512),
                tap(512),
                fire(12, 512, 64, 512),
                tap(512),
            ],
        }
    }

    /// All convolutions, in the order of the layers.
    pub(super) fn convolutions(self) -> Vec<Conv> {
        let of_layer = |layer| match layer {
            Layer::Conv(conv) => vec![conv],
            Layer::Fire(parts) => parts.to_vec(),
            Layer::Pool { .. } | Layer::Tap { .. } => Vec::new(),
        };
        self.layers().into_iter().flat_map(of_layer).collect()
    }

    /// Channels of the compared features.
    pub(super) fn tap_channels(self) -> Vec<usize> {
        let channels = |layer| if let Layer::Tap { channels } = layer { Some(channels) } else { None };
        self.layers().into_iter().filter_map(channels).collect()
    }
}

impl Layer {
    /// The side of the output for a side of the input; `None` if there would be no output.
    fn side(&self, side: usize) -> Option<usize> {
        match self {
            Layer::Conv(conv) => Some((side + 2 * conv.padding).checked_sub(conv.kernel)? / conv.stride + 1),
            // A window that reaches beyond the edge still has two pixels inside.
            Layer::Pool { kernel, ceil: true } => Some((side + 1).checked_sub(*kernel)? / 2 + 1),
            Layer::Pool { kernel, ceil: false } => Some(side.checked_sub(*kernel)? / 2 + 1),
            Layer::Fire(_) | Layer::Tap { .. } => Some(side),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_fit_together() {
        for backbone in Backbone::ALL {
            let mut channels = 3;
            for layer in backbone.layers() {
                match layer {
                    Layer::Conv(conv) => {
                        assert_eq!(conv.inputs, channels, "{backbone}: {}", conv.name);
                        channels = conv.outputs;
                    }
                    Layer::Fire(parts) => {
                        let [squeeze, expand1, expand3] = *parts;
                        assert_eq!([squeeze.inputs, expand1.inputs, expand3.inputs], {
                            [channels, squeeze.outputs, squeeze.outputs]
                        });
                        channels = expand1.outputs + expand3.outputs;
                    }
                    Layer::Tap { channels: compared } => assert_eq!(compared, channels),
                    Layer::Pool { .. } => {}
                }
            }
        }
    }

    #[test]
    fn backbones_have_the_published_number_of_parameters() {
        // Sums over torchvision's feature layers.
        for (backbone, expected) in
            [(Backbone::Alex, 2_469_696), (Backbone::Vgg, 14_714_688), (Backbone::Squeeze, 722_496)]
        {
            let count = |conv: Conv| conv.shapes().map(|shape| shape.iter().product::<usize>()).iter().sum::<usize>();
            assert_eq!(backbone.convolutions().into_iter().map(count).sum::<usize>(), expected, "{backbone}");
        }
    }

    #[test]
    fn smallest_sides_are_those_at_which_pytorch_stops_failing() {
        let sides = Backbone::ALL.map(Backbone::smallest_side);
        assert_eq!(sides, [31, 16, 17]);
    }
}
