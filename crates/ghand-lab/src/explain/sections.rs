//! The figures, from the numbers of an avatar.

use ghand_app::commands::bake::hand_painter::{Dots, HandPainter, PALE, around, palm_and_back};
use ghand_avatar::Avatar;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::{Camera, Pose};
use ghand_pictures::color_scale::{ColorScale, Colors, short};
use ghand_pictures::plot::{IntervalPlot, Panel, PanelPlot};
use ghand_render::Gpu;
use glam::DVec3;
use image::RgbImage;

use super::avatar_properties::{AvatarProperties, PropertiesInPose};
use super::figures::{Figures, MM, most_bent, residual_joints};
use super::page::{Cell, Figure, Section, beside, figure};
use super::skeleton_picture::{Pen, RESIDUAL, TEMPLATE, draw_skeleton, fade};
use super::surface_normals::moved_normals;

/// Sizes of a picture of a basis, of a joint's weights, of a pose, and of skeletons, pixels.
const BASIS: [u32; 2] = [225, 285];
const WEIGHTS: [u32; 2] = [200, 255];
const POSE: [u32; 2] = [184, 236];
const LARGE: [u32; 2] = [400, 620];
/// Most poses that are shown beside each other.
const MOST_SHOWN: usize = 6;
/// Light from everywhere on colours with a meaning, and on plain hands.
const FLAT_LIGHT: f64 = 0.62;
const SHAPING_LIGHT: f64 = 0.3;
/// Length that the largest offset of a residual joint is enlarged to, metres.
const VISIBLE: f64 = 0.012;

/// Smaller offsets of all joints are rounding, millimetres.
const LEAST_OFFSET_MM: f64 = 1e-4;

/// Draws what the figures need.
struct Painter<'a> {
    hands: HandPainter<'a>,
    avatar: &'a Avatar,
    explained: &'a AvatarProperties,
}

/// Draws all sections.
///
/// # Errors
/// An error if the device failed or a plot cannot be drawn.
pub fn draw(
    gpu: &Gpu,
    avatar: &Avatar,
    explained: &AvatarProperties,
    figures: &Figures,
) -> anyhow::Result<Vec<Section>> {
    let hands = HandPainter::new(gpu, &avatar.template.spacings, LARGE)?;
    let mut painter = Painter { hands, avatar, explained };
    Ok(vec![
        painter.shape_bases(figures)?,
        painter.coefficients(figures)?,
        painter.residual_weights(figures)?,
        painter.residual_skeleton(figures)?,
        painter.corrected_skinning(figures)?,
    ])
}

impl Painter<'_> {
    /// Values on the hand in a pose.
    fn values(
        &mut self,
        pose: &PropertiesInPose,
        values: &[f64],
        scale: &ColorScale,
        camera: &Camera,
    ) -> anyhow::Result<RgbImage> {
        self.painted(&pose.posed, &pose.normals, values, scale, camera)
    }

    fn painted(
        &mut self,
        positions: &[DVec3],
        normals: &[DVec3],
        values: &[f64],
        scale: &ColorScale,
        camera: &Camera,
    ) -> anyhow::Result<RgbImage> {
        let colors: Vec<DVec3> = values.iter().map(|value| scale.color(*value)).collect();
        Ok(self.hands.draw(&Dots { positions, normals, colors: &colors, ambient: FLAT_LIGHT }, camera)?)
    }

    fn pale(&mut self, positions: &[DVec3], normals: &[DVec3], camera: &Camera) -> anyhow::Result<RgbImage> {
        let colors = vec![PALE; positions.len()];
        Ok(self.hands.draw(&Dots { positions, normals, colors: &colors, ambient: SHAPING_LIGHT }, camera)?)
    }

    fn cameras_at_rest(&self, size: [u32; 2]) -> [(&'static str, Camera); 2] {
        let rest = Pose::rest(self.avatar.template.joint_count());
        let [palm, back] = palm_and_back(&self.avatar.model, &rest, size);
        [("palm", palm), ("back", back)]
    }

    fn shape_bases(&mut self, figures: &Figures) -> anyhow::Result<Section> {
        let explained = self.explained;
        let mut drawn = vec![];
        for (i, numbers) in figures.shape_bases.iter().enumerate() {
            let basis = explained.basis(i);
            let lengths: Vec<f64> = basis.iter().map(|s| MM * s.length()).collect();
            let scale = ColorScale::new(Colors::Viridis, lengths.iter().copied(), "|S|, mm");
            let factor = numbers.largest_coefficient;
            let moved: Vec<DVec3> = explained.rest.iter().zip(basis).map(|(x, s)| *x + factor * *s).collect();
            let normals = moved_normals(&self.avatar.template, &explained.normals, &moved);
            let mut cells = vec![];
            for (side, camera) in self.cameras_at_rest(BASIS) {
                let picture = self.painted(&explained.rest, &explained.normals, &lengths, &scale, &camera)?;
                cells.push(Cell { title: format!("|S|, {side}"), picture });
            }
            for (side, camera) in self.cameras_at_rest(BASIS) {
                let picture = self.pale(&moved, &normals, &camera)?;
                cells.push(Cell { title: format!("rest + {} S, {side}", short(factor)), picture });
            }
            let title = format!(
                "Basis {}: |S| {} mm on average, at most {} mm",
                i + 1,
                short(numbers.mean_length_mm),
                short(numbers.max_length_mm)
            );
            let picture = figure(&title, &[cells], |height| Some(scale.legend(height)));
            drawn.push(Figure { file: format!("basis-{}.png", i + 1), picture });
        }
        let text = vec![
            "Colours: length of the basis. Grey: the hand at rest displaced by the basis, times the largest size of a \
             coefficient over the poses."
                .to_owned(),
        ];
        Ok(Section { heading: "Shape bases".into(), text, figures: drawn })
    }

    fn coefficients(&mut self, figures: &Figures) -> anyhow::Result<Section> {
        let explained = self.explained;
        let poses = explained.poses.len().max(1);
        let panel = |(i, of_basis): (usize, &[super::figures::CoefficientFigures])| Panel {
            title: format!("basis {}", i + 1),
            values: of_basis
                .iter()
                .map(|c| [c.mean, c.mean - c.standard_deviation, c.mean + c.standard_deviation])
                .collect(),
        };
        let plot = PanelPlot {
            title: "Blend coefficients: mean and standard deviation over the hand".into(),
            names: figures.poses.clone(),
            panels: figures.coefficients.chunks(poses).enumerate().map(panel).collect(),
        };
        let mut drawn = vec![Figure { file: "coefficients.png".into(), picture: plot.to_image()? }];
        let mut text = vec![format!("A coefficient is {}.", figures.coefficients_are)];
        match figures.most_pose_dependent_basis {
            None => text.push("The coefficients are the same in all poses.".into()),
            Some(number) => {
                text.push(format!(
                    "Pictures: how far the coefficients of basis {number}, which moves the hand most from pose to pose, are \
                     from those at rest."
                ));
                drawn.push(self.coefficients_on_the_hand(number)?);
            }
        }
        Ok(Section { heading: "Blend coefficients in poses".into(), text, figures: drawn })
    }

    fn coefficients_on_the_hand(&mut self, number: usize) -> anyhow::Result<Figure> {
        let explained = self.explained;
        let all: Vec<Vec<f64>> =
            explained.poses.iter().map(|pose| explained.relative_coefficients(pose, number - 1)).collect();
        let sizes: Vec<f64> = all.iter().map(|values| values.iter().map(|v| v * v).sum()).collect();
        let shown = largest(&sizes);
        let scale =
            ColorScale::new(Colors::Diverging, shown.iter().flat_map(|k| all[*k].iter().copied()), "C - C(rest)");
        let rows = self.in_poses(&shown, |k| all[k].as_slice(), &scale)?;
        let title = format!("Basis {number}: coefficients less those at rest, from the palm and from the back");
        let picture = figure(&title, &rows, |height| Some(scale.legend(height)));
        Ok(Figure { file: format!("coefficients-basis-{number}.png"), picture })
    }

    /// Two rows: values on the hand in poses, from the palm and from the back.
    fn in_poses<'v>(
        &mut self,
        shown: &[usize],
        values: impl Fn(usize) -> &'v [f64],
        scale: &ColorScale,
    ) -> anyhow::Result<[Vec<Cell>; 2]> {
        let explained = self.explained;
        let mut rows = [vec![], vec![]];
        for k in shown {
            let Some(pose) = explained.poses.get(*k) else { continue };
            let cameras = palm_and_back(&self.avatar.model, &pose.pose, POSE);
            for (row, camera) in rows.iter_mut().zip(&cameras) {
                let picture = self.values(pose, values(*k), scale, camera)?;
                row.push(Cell { title: pose.id.clone(), picture });
            }
        }
        Ok(rows)
    }

    fn residual_weights(&mut self, figures: &Figures) -> anyhow::Result<Section> {
        let explained = self.explained;
        let joints = residual_joints(self.avatar, explained);
        let all = joints.iter().flat_map(|joint| explained.joint_weights(*joint).iter().copied());
        let scale = ColorScale::new(Colors::Diverging, all, "weight");
        let mut drawn = vec![];
        for (joint, numbers) in joints.iter().zip(&figures.residual_weights) {
            let weights = explained.joint_weights(*joint);
            let mut cells = vec![];
            for (side, camera) in self.cameras_at_rest(WEIGHTS) {
                let picture = self.painted(&explained.rest, &explained.normals, weights, &scale, &camera)?;
                cells.push(Cell { title: side.into(), picture });
            }
            let title = format!("{}: {} to {}", numbers.joint, short(numbers.min), short(numbers.max));
            let picture = figure(&title, &[cells], |height| Some(scale.legend(height)));
            drawn.push(Figure { file: format!("residual-weights-{joint:02}-{}.png", plain(&numbers.joint)), picture });
        }
        let text = if drawn.is_empty() {
            "There are none: the skinning is plain linear blend skinning.".to_owned()
        } else {
            format!(
                "One pair of pictures for each joint that has any, all on one scale; weights {}.",
                figures.residual_weights_are
            )
        };
        Ok(Section { heading: "Residual skinning weights".into(), text: vec![text], figures: drawn })
    }

    fn residual_skeleton(&mut self, figures: &Figures) -> anyhow::Result<Section> {
        let heading = "Residual skeleton".to_owned();
        let (Some(numbers), Some(pose)) = (&figures.residual_skeleton, most_bent(self.explained)) else {
            let text = vec!["Without residual weights it has no effect.".to_owned()];
            return Ok(Section { heading, text, figures: vec![] });
        };
        if numbers.joints.iter().all(|joint| joint.offset_mm < LEAST_OFFSET_MM) {
            let text = vec!["The regressor adds nothing to any joint.".to_owned()];
            return Ok(Section { heading, text, figures: vec![] });
        }
        let parents = &self.avatar.template.parents;
        let anchored = self.avatar.config.residual_skeleton == ResidualSkeleton::Anchored;
        let (enlarged, factor) = enlarged(pose, anchored);
        // From half the side, where bent fingers do not hide each other; the same side for left hands.
        let view = if self.avatar.template.side == ghand_core::Side::Right { 5 } else { 1 };
        let camera = around(&self.avatar.model, &pose.pose, view, 6, LARGE);
        let mut hand = self.pale(&pose.posed, &pose.normals, &camera)?;
        fade(&mut hand);
        let with = |skeletons: &[(&[DVec3], Pen)]| {
            let mut picture = hand.clone();
            skeletons.iter().for_each(|(joints, pen)| draw_skeleton(&mut picture, &camera, parents, joints, *pen));
            picture
        };
        let template: (&[DVec3], Pen) = (&pose.joints, TEMPLATE);
        let beside_template = |residual: (&[DVec3], Pen)| {
            if anchored { with(&[template, residual]) } else { with(&[residual]) }
        };
        let shown = if anchored { "both: template blue, residual orange" } else { "the residual skeleton" };
        let mut cells = vec![
            Cell { title: "the template's skeleton".into(), picture: with(&[template]) },
            Cell { title: shown.into(), picture: beside_template((&pose.residual_joints, RESIDUAL)) },
        ];
        if factor > 1.0 {
            let title = format!("{} {} times enlarged", if anchored { "both, offsets" } else { shown }, short(factor));
            cells.push(Cell { title, picture: beside_template((&enlarged, RESIDUAL)) });
        }
        let title = format!("Pose {}; the joints of the residual skeleton are {}", numbers.pose, numbers.joints_are);
        let rows = numbers.joints.iter().map(|joint| (joint.joint.clone(), [joint.offset_mm, 0.0, joint.offset_mm]));
        let axis = "length of R Delta, mm".to_owned();
        let plot = IntervalPlot { title: "What the regressor adds to a joint".into(), axis, rows: rows.collect() };
        let picture = beside(&[figure(&title, &[cells], |_| None), plot.to_image()?]);
        let figures = vec![Figure { file: "residual-skeleton.png".into(), picture }];
        let text = vec!["In the most bent pose, from the side of the thumb.".to_owned()];
        Ok(Section { heading, text, figures })
    }

    fn corrected_skinning(&mut self, figures: &Figures) -> anyhow::Result<Section> {
        let heading = "What the residual terms move".to_owned();
        if figures.residual_weights.is_empty() {
            let text = vec!["Nothing, in any pose.".to_owned()];
            return Ok(Section { heading, text, figures: vec![] });
        }
        let explained = self.explained;
        let all: Vec<Vec<f64>> =
            explained.poses.iter().map(|pose| pose.moved.iter().map(|moved| MM * moved).collect()).collect();
        let sizes: Vec<f64> = all.iter().map(|values| values.iter().sum()).collect();
        let shown = largest(&sizes);
        let scale = ColorScale::new(Colors::Viridis, shown.iter().flat_map(|k| all[*k].iter().copied()), "mm");
        let rows = self.in_poses(&shown, |k| all[k].as_slice(), &scale)?;
        let title = "Distance between corrected and plain linear blend skinning, from the palm and from the back";
        let map = figure(title, &rows, |height| Some(scale.legend(height)));
        let of = |m: &super::figures::MovedFigures| (m.pose.clone(), [m.median_mm, m.p5_mm, m.p95_mm]);
        let plot = IntervalPlot {
            title: "Corrected against plain skinning".into(),
            axis: "mm: median, and from 5 % to 95 % of the hand".into(),
            rows: figures.moved_by_residual_terms.iter().map(of).collect(),
        };
        let most = figures.moved_by_residual_terms.iter().map(|m| m.max_mm).fold(0.0, f64::max);
        let text = vec![format!(
            "How far Gaussians are from where plain linear blend skinning puts them: at most {} mm.",
            short(most)
        )];
        let figures = vec![
            Figure { file: "corrected-skinning.png".into(), picture: plot.to_image()? },
            Figure { file: "corrected-skinning-poses.png".into(), picture: map },
        ];
        Ok(Section { heading, text, figures })
    }
}

/// The posed residual joints with their distances from the template's enlarged so that they are visible, or, without an
/// anchor, the whole residual skeleton enlarged in the middle of the hand; and how much, a round number.
fn enlarged(pose: &PropertiesInPose, anchored: bool) -> (Vec<DVec3>, f64) {
    let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let farthest = |points: &[DVec3], from: DVec3| points.iter().map(|p| p.distance(from)).fold(0.0, f64::max);
    let target = mean(&pose.joints);
    let origin = mean(&pose.residual_joints);
    let pairs = || pose.joints.iter().zip(&pose.residual_joints);
    let wanted = if anchored {
        VISIBLE / pairs().map(|(a, b)| a.distance(*b)).fold(1e-9, f64::max)
    } else {
        farthest(&pose.joints, target) / farthest(&pose.residual_joints, origin).max(1e-9)
    };
    let power = 10f64.powf(wanted.log10().floor());
    let factor = ([5.0, 2.0].into_iter().find(|step| step * power <= wanted).unwrap_or(1.0) * power).clamp(1.0, 1e6);
    let moved = pairs().map(|(a, b)| if anchored { *a + factor * (*b - *a) } else { target + factor * (*b - origin) });
    (moved.collect(), factor)
}

/// Numbers of the largest values, at most [`MOST_SHOWN`], in their order.
fn largest(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).filter(|k| values[*k] > 0.0).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    order.truncate(MOST_SHOWN);
    order.sort_unstable();
    order
}

/// A name as part of a file's name.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '-' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_are_shown_in_their_order() {
        assert_eq!(largest(&[0.0, 3.0, 1.0, 2.0, 9.0, 8.0, 7.0, 6.0]), [1, 3, 4, 5, 6, 7]);
        assert!(largest(&[0.0]).is_empty());
        assert_eq!(plain("../index 1"), "---index-1");
    }
}
