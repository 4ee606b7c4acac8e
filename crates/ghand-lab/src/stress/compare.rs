//! Errors in roundings.

/// Half a unit in the last place of an f32 of size 1.
const ROUNDING: f64 = 5.960_464_477_539_063e-8;
/// Largest part of a picture's values that may differ because rounding decides whether a contribution of 1/255 is drawn, or
/// which of two Gaussians is in front.
const FLIPPED: f64 = 0.02;
/// Rounding of a blended value, display values: sums of some hundred contributions.
const BLENDED: f64 = 1e-6;

/// A number moved by one unit in its last place, up or down.
pub fn move_by_one(value: f32, up: bool) -> f32 {
    match up {
        true => value.next_up(),
        false => value.next_down(),
    }
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

/// How many roundings the device's numbers are off, as a whole (L2). `moved` is what moved inputs give; `least` is the size
/// below which a number of the part need not be exact, in its unit.
pub fn roundings(device: &[f32], exact: &[f64], moved: &[f64], least: f64) -> f64 {
    if exact.iter().any(|v| !v.is_finite()) {
        return 0.0;
    }
    let error = norm(device.iter().zip(exact).map(|(a, b)| f64::from(*a) - b));
    let change = norm(moved.iter().zip(exact).map(|(a, b)| a - b));
    let size = norm(exact.iter().copied()).max(least * (exact.len() as f64).sqrt());
    let roundings = error / (change + ROUNDING * size);
    match (error == 0.0, roundings.is_nan()) {
        (true, _) => 0.0,
        (_, true) => f64::INFINITY,
        _ => roundings,
    }
}

/// The value that a part `FLIPPED` of some differences exceeds.
fn typical(mut differences: Vec<f64>) -> f64 {
    differences.sort_by(f64::total_cmp);
    let at = ((1.0 - FLIPPED) * differences.len() as f64) as usize;
    differences.get(at.min(differences.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Differences of two images' pixels.
fn differences(image: &[[f32; 4]], exact: &[[f64; 4]]) -> Vec<f64> {
    let of = |(a, b): (&[f32; 4], &[f64; 4])| (0..4).map(|c| (f64::from(a[c]) - b[c]).abs()).fold(0.0, f64::max);
    image.iter().zip(exact).map(of).collect()
}

/// Which pixels of some images of the same view differ at all: where thresholds that are a little lower and higher change
/// something, rounding may decide.
pub fn undecided(images: [&[[f64; 4]]; 3]) -> Vec<bool> {
    let [low, exact, high] = images;
    low.iter().zip(exact).zip(high).map(|((low, exact), high)| low != exact || high != exact).collect()
}

/// How many roundings the device's picture is off where it is decided, `None` if that is nowhere; and which of its pixels
/// rounding may have decided otherwise.
pub fn picture(
    image: &[[f32; 4]],
    exact: &[[f64; 4]],
    moved: &[[f64; 4]],
    undecided: &[bool],
) -> (Option<f64>, Vec<bool>) {
    let errors = differences(image, exact);
    let change = |(a, b): (&[f64; 4], &[f64; 4])| (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max);
    let changes: Vec<f64> = moved.iter().zip(exact).map(change).collect();
    let decided = |values: &[f64]| -> Vec<f64> {
        values.iter().zip(undecided).filter(|(_, undecided)| !**undecided).map(|(v, _)| *v).collect()
    };
    let allowed = typical(decided(&changes)) + BLENDED;
    let flipped =
        errors.iter().zip(undecided).map(|(error, undecided)| *undecided || error.is_nan() || *error > 20.0 * allowed);
    let decided = decided(&errors);
    let roundings = (!decided.is_empty()).then(|| typical(decided) / allowed);
    (roundings, flipped.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rounding_of_a_plain_number_is_one_and_lost_digits_are_many() {
        let exact = [1.0, 2.0];
        let moved = [1.0 + ROUNDING, 2.0];
        assert_eq!(roundings(&[1.0, 2.0], &exact, &moved, 0.0), 0.0);
        let one = roundings(&[1.0f32.next_up(), 2.0], &exact, &moved, 0.0);
        assert!((0.1..2.0).contains(&one), "{one}");
        assert!(roundings(&[1.001, 2.0], &exact, &moved, 0.0) > 1000.0);
        assert_eq!(roundings(&[f32::NAN, 2.0], &exact, &moved, 0.0), f64::INFINITY);
        // A number that cancels to nothing is as exact as what it is a part of.
        assert!(roundings(&[1e-9], &[0.0], &[0.0], 1.0) < 1.0);
    }

    #[test]
    fn a_flipped_pixel_is_told_from_a_wrong_picture() {
        let exact = vec![[0.5; 4]; 100];
        let mut image = vec![[0.5f32; 4]; 100];
        image[7] = [0.504; 4];
        let decided = vec![false; 100];
        let (error, flipped) = picture(&image, &exact, &exact, &decided);
        assert!(error == Some(0.0) && flipped.iter().filter(|f| **f).count() == 1 && flipped[7]);
        assert!(picture(&[[0.501; 4]; 100], &exact, &exact, &decided).0.unwrap() > 500.0);
        assert_eq!(picture(&image, &exact, &exact, &[true; 100]).0, None);
    }
}
