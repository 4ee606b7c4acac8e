//! Chooses a few cameras with very different views.

use ghand_core::Camera;

/// `count` of the cameras' indices, each the farthest from those before it, starting with the first.
pub fn farthest_point_sampling(cameras: &[Camera], among: &[usize], count: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = among.first().copied().into_iter().collect();
    while chosen.len() < count.min(among.len()) {
        let gap = |&i: &usize| {
            let distances = chosen.iter().map(|&j| cameras[i].center().distance(cameras[j].center()));
            distances.fold(f64::INFINITY, f64::min)
        };
        match among.iter().copied().max_by(|a, b| gap(a).total_cmp(&gap(b))) {
            Some(next) => chosen.push(next),
            None => break,
        }
    }
    chosen.sort_unstable();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn each_camera_is_the_farthest_from_those_before_it() {
        let at = |x: f64| Camera::look_at(DVec3::new(x, 0.0, -1.0), DVec3::new(x, 0.0, 0.0), DVec3::Y, 0.5, 8, 8);
        let cameras: Vec<Camera> = [5.0, 0.0, 1.0, 4.0, 10.0, 7.5].into_iter().map(at).collect();
        assert_eq!(farthest_point_sampling(&cameras, &[1, 2, 3, 4, 5], 3), [1, 3, 4]);
        assert_eq!(farthest_point_sampling(&cameras, &[1, 2], 5), [1, 2]);
        assert_eq!(farthest_point_sampling(&cameras, &[], 5), [0usize; 0]);
    }
}
