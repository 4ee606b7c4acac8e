//! The texture: what is seen of each texel's place from straight above.

use ghand_core::HandModel;
use ghand_core::mesh::Texture;
use ghand_hand_model::HandModelError;
use ghand_hand_model::surface::sample_surface;
use glam::DVec3;
use rayon::prelude::*;

use super::line_of_sight::{Cloud, Line};

/// Texels beyond the charts' edges that take their neighbours' colours, in parts of the texture's edge: eight levels of
/// detail blend no background into a chart.
const MARGIN: f64 = 1.0 / 64.0;
/// A line that is covered less says little of the colour; its texel takes those of its neighbours.
const LEAST_COVERED: f64 = 0.1;

/// The colours of a hand at rest on its UV atlas, `size` x `size` texels.
///
/// # Errors
/// [`HandModelError`] if the model has no usable atlas.
pub fn bake(model: &HandModel, cloud: &Cloud, size: u32) -> Result<Texture, HandModelError> {
    let samples = sample_surface(model, size)?;
    let places: Vec<(&DVec3, &DVec3)> = samples.positions.iter().zip(&samples.normals).collect();
    let seen: Vec<Option<DVec3>> = (places.par_iter())
        .map(|(place, normal)| {
            let line = Line { place: **place, outwards: **normal, along: -**normal };
            cloud.seen(&line).filter(|(_, covered)| *covered >= LEAST_COVERED).map(|(color, _)| color)
        })
        .collect();
    let mut colors = vec![None; size as usize * size as usize];
    for (texel, color) in samples.texels.iter().zip(seen) {
        colors[*texel as usize] = color;
    }
    let rounds = (f64::from(size) * MARGIN).ceil() as usize;
    let rgb = fill(colors, size as usize, rounds).into_iter().map(|color| {
        let byte = |v: f64| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        color.to_array().map(byte)
    });
    Ok(Texture { width: size, height: size, rgb: rgb.collect() })
}

/// Gives texels without a colour the mean of their neighbours', in this many rounds, and then the mean of all.
fn fill(mut colors: Vec<Option<DVec3>>, size: usize, rounds: usize) -> Vec<DVec3> {
    let mean_of = |known: &mut dyn Iterator<Item = DVec3>| {
        let (sum, count) = known.fold((DVec3::ZERO, 0.0), |(sum, count), color| (sum + color, count + 1.0));
        (count > 0.0).then(|| sum / count)
    };
    let all = mean_of(&mut colors.iter().flatten().copied()).unwrap_or(DVec3::splat(0.5));
    for _ in 0..rounds {
        let grown: Vec<(usize, DVec3)> = (0..colors.len())
            .into_par_iter()
            .filter(|texel| colors[*texel].is_none())
            .filter_map(|texel| {
                let [row, column] = [texel / size, texel % size];
                let rows = row.saturating_sub(1)..(row + 2).min(size);
                let columns = column.saturating_sub(1)..(column + 2).min(size);
                let near = rows.flat_map(|row| columns.clone().map(move |column| row * size + column));
                mean_of(&mut near.filter_map(|texel| colors[texel])).map(|color| (texel, color))
            })
            .collect();
        if grown.is_empty() {
            break;
        }
        grown.into_iter().for_each(|(texel, color)| colors[texel] = Some(color));
    }
    colors.into_iter().map(|color| color.unwrap_or(all)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_grow_round_by_round_and_the_rest_gets_the_mean() {
        let mut colors = vec![None; 49];
        colors[0] = Some(DVec3::X);
        colors[2] = Some(DVec3::Y);
        let filled = fill(colors, 7, 1);
        assert_eq!(filled[1], DVec3::new(0.5, 0.5, 0.0));
        assert_eq!((filled[7], filled[3], filled[8]), (DVec3::X, DVec3::Y, DVec3::new(0.5, 0.5, 0.0)));
        // Two texels away from any colour.
        assert_eq!((filled[14], filled[48]), (DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.5, 0.5, 0.0)));
        assert_eq!(fill(vec![None; 4], 2, 3), [DVec3::splat(0.5); 4]);
    }
}
