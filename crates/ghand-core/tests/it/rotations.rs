//! Rotations and their derivative against a table of 50 digits (made by `scripts/rotation_table.py`), their logarithm,
//! and all three at extreme numbers.

use std::f64::consts::{PI, TAU};

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle, rotation_from_axis_angle_vjp};
use glam::{DMat3, DVec3};

struct Row {
    name: String,
    v: DVec3,
    rotation: [f64; 9],
    d_rotation: DMat3,
    gradient: [f64; 3],
}

fn table() -> Vec<Row> {
    let row = |line: &str| {
        let (name, numbers) = line.split_once(" | ").unwrap();
        let numbers: Vec<f64> =
            numbers.split(' ').map(|bits| f64::from_bits(u64::from_str_radix(bits, 16).unwrap())).collect();
        assert_eq!(numbers.len(), 24);
        Row {
            name: name.to_owned(),
            v: DVec3::from_slice(&numbers[..3]),
            rotation: numbers[3..12].try_into().unwrap(),
            d_rotation: DMat3::from_cols_slice(&numbers[12..21]).transpose(),
            gradient: numbers[21..].try_into().unwrap(),
        }
    };
    include_str!("../data/rotations.txt").lines().filter(|line| !line.starts_with('#')).map(row).collect()
}

/// The larger error; NaN counts as the largest.
fn worse(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

/// Largest difference in units in the last place of `size`.
fn ulps(found: &[f64], right: &[f64], size: f64) -> f64 {
    let ulp = size.next_up() - size;
    found.iter().zip(right).fold(0.0, |worst, (a, b)| worse(worst, (a - b).abs() / ulp))
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, x| worse(m, x.abs()))
}

/// Allowed units in the last place. Measured are at most 5 (rotation at 1e4 rad, derivative at 1e15 rad).
const A_FEW_ULPS: f64 = 6.0;

#[test]
fn rotations_and_their_derivative_are_exact_to_a_few_ulps_at_every_angle() {
    let mut worst: Vec<(String, [f64; 2])> = vec![];
    for row in table() {
        let rotation = rotation_from_axis_angle(row.v).transpose().to_cols_array();
        let gradient = rotation_from_axis_angle_vjp(row.v, &row.d_rotation).to_array();
        // The gradient sums products of the given derivative and numbers up to 1.
        let gradient_size = largest(&row.gradient).max(largest(&row.d_rotation.to_cols_array()));
        let errors =
            [ulps(&rotation, &row.rotation, largest(&row.rotation)), ulps(&gradient, &row.gradient, gradient_size)];
        let angle = row.name.split(" about ").next().unwrap();
        if worst.last().is_none_or(|(last, _)| last != angle) {
            worst.push((angle.to_owned(), errors));
        }
        let entry = &mut worst.last_mut().unwrap().1;
        (0..2).for_each(|k| entry[k] = worse(entry[k], errors[k]));
    }
    println!("| angle | rotation, ulps | derivative, ulps |\n|---|---|---|");
    worst.iter().for_each(|(angle, [r, d])| println!("| {angle} | {r:.1} | {d:.1} |"));
    for (angle, errors) in worst {
        assert!(errors.iter().all(|e| *e <= A_FEW_ULPS), "{angle}: {errors:?} ulps");
    }
}

#[test]
fn the_table_rejects_a_slightly_wrong_rotation() {
    for row in table() {
        for entry in 0..9 {
            let mut wrong = row.rotation;
            wrong[entry] += 2e-15;
            assert!(!(ulps(&wrong, &row.rotation, largest(&row.rotation)) <= A_FEW_ULPS), "{}", row.name);
            wrong[entry] = f64::NAN;
            assert!(!(ulps(&wrong, &row.rotation, largest(&row.rotation)) <= A_FEW_ULPS), "{}", row.name);
        }
    }
}

/// Unit axes: all coordinate axes both ways, diagonals, and some nearly along an axis.
fn axes() -> Vec<DVec3> {
    let mut axes: Vec<DVec3> = DVec3::AXES.into_iter().flat_map(|a| [a, -a]).collect();
    for x in [-1.0, 1e-12, 1.0] {
        for y in [-1.0, 1e-5, 0.7] {
            for z in [-0.3, 1e-9, 1.0] {
                axes.push(DVec3::new(x, y, z).normalize());
            }
        }
    }
    axes
}

#[test]
fn the_logarithm_inverts_the_rotation_at_every_angle_up_to_a_half_turn() {
    let mut worst: f64 = 0.0;
    for angle in [0.0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 0.1, 0.5, 1.0, 2.0, 3.0, PI - 1e-4, PI - 1e-9] {
        for axis in axes() {
            let v = axis * angle;
            let back = axis_angle_from_rotation(&rotation_from_axis_angle(v));
            // Relative: tiny angles keep all their digits.
            let error = if angle == 0.0 { back.length() } else { ((back - v) / angle).length() };
            worst = worse(worst, error);
            assert!(error <= 4e-15, "{angle} about {axis}: {error}");
        }
    }
    println!("log(exp(v)) = v: relative error {worst:.1e}");
}

#[test]
fn the_rotation_inverts_the_logarithm_and_a_half_turn_has_either_axis() {
    let mut worst: f64 = 0.0;
    for angle in [0.0, 1e-12, 1.0, PI - 1e-9, PI, PI + 1e-9, 4.0, TAU - 1e-9, TAU, 100.0, 1e8] {
        for axis in axes() {
            let rotation = rotation_from_axis_angle(axis * angle);
            let v = axis_angle_from_rotation(&rotation);
            assert!(v.length() <= PI + 1e-15);
            let error = largest(&(rotation_from_axis_angle(v) - rotation).to_cols_array());
            worst = worse(worst, error);
            assert!(error <= 3e-15, "{angle} about {axis}: {error}");
            if angle == PI {
                assert!((v - axis * PI).length().min((v + axis * PI).length()) <= 3e-15, "{axis}: {v}");
            }
        }
    }
    println!("exp(log(R)) = R: largest error of an entry {worst:.1e}");
}

#[test]
fn huge_angles_still_give_rotations() {
    for angle in [1e15, 1e16, 1e100, 1e154, 1e155, 1e200, 1e308] {
        for axis in axes() {
            let v = axis * angle;
            let rotation = rotation_from_axis_angle(v);
            let error = largest(&(rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array());
            assert!(error <= 4e-15, "{v}: {error}");
            let gradient = rotation_from_axis_angle_vjp(v, &DMat3::from_cols_array(&[1.0; 9]));
            assert!(gradient.is_finite(), "{v}: {gradient}");
        }
    }
}

#[test]
fn the_smallest_numbers_are_valid_angles() {
    let tiny = f64::from_bits(1);
    for v in [DVec3::splat(tiny), DVec3::new(tiny, 0.0, -tiny), DVec3::new(1e-310, -1e-320, 0.0)] {
        let rotation = rotation_from_axis_angle(v);
        assert_eq!(rotation.y_axis.z, v.x);
        let d_rotation =
            DMat3::from_cols(DVec3::new(0.0, 3.0, 0.0), DVec3::new(0.0, 0.0, 1.0), DVec3::new(2.0, 0.0, 0.0));
        assert_eq!(rotation_from_axis_angle_vjp(v, &d_rotation), DVec3::new(1.0, 2.0, 3.0));
        // Halving a subnormal number may round it.
        assert!((axis_angle_from_rotation(&rotation) - v).abs().max_element() <= 2.0 * tiny);
    }
}

#[test]
fn nan_gives_nan() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for k in 0..3 {
            let mut v = DVec3::new(0.1, 0.2, 0.3);
            v[k] = bad;
            assert!(rotation_from_axis_angle(v).to_cols_array().iter().all(|x| x.is_nan()), "{v}");
            assert!(rotation_from_axis_angle_vjp(v, &DMat3::IDENTITY).is_nan(), "{v}");
        }
        for k in 0..9 {
            let mut entries = DMat3::IDENTITY.to_cols_array();
            entries[k] = bad;
            let matrix = DMat3::from_cols_array(&entries);
            assert!(axis_angle_from_rotation(&matrix).is_nan(), "{matrix}");
        }
    }
}
