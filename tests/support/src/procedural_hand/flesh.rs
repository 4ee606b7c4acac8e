//! The solid hand as an implicit surface: tapered capsules joined by smooth unions.
//!
//! The same code serves the solid (3D) and the outline of the flat cloth pattern (2D, height 0).

use glam::DVec3;

/// A capsule whose radius changes linearly from `from` to `to`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Capsule {
    pub from: DVec3,
    pub to: DVec3,
    pub from_radius: f64,
    pub to_radius: f64,
}

/// Value (metres, negative inside; close to a distance near the surface) and gradient of an implicit surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    pub value: f64,
    pub gradient: DVec3,
}

impl Capsule {
    pub(super) fn new(from: DVec3, from_radius: f64, to: DVec3, to_radius: f64) -> Capsule {
        Capsule { from, to, from_radius, to_radius }
    }

    pub(super) fn ball(center: DVec3, radius: f64) -> Capsule {
        Capsule::new(center, radius, center, radius)
    }

    fn field(&self, p: DVec3) -> Field {
        let axis = self.to - self.from;
        let squared = axis.length_squared();
        let raw = if squared > 0.0 { (p - self.from).dot(axis) / squared } else { 0.0 };
        let t = raw.clamp(0.0, 1.0);
        let offset = p - self.from - t * axis;
        let distance = offset.length();
        let mut gradient = if distance > 0.0 { offset / distance } else { DVec3::X };
        if raw > 0.0 && raw < 1.0 {
            gradient -= axis * ((self.to_radius - self.from_radius) / squared);
        }
        Field { value: distance - (self.from_radius + t * (self.to_radius - self.from_radius)), gradient }
    }
}

/// The field of an empty solid: infinitely far away.
const NOWHERE: Field = Field { value: f64::INFINITY, gradient: DVec3::ZERO };

impl Field {
    /// Union with a fillet; `reach` (metres) is the largest difference of the two values that still blends.
    fn smooth_union(self, other: Field, reach: f64) -> Field {
        if self.value == f64::INFINITY {
            return other;
        }
        let (near, far) = if self.value <= other.value { (self, other) } else { (other, self) };
        let blend = ((reach - (far.value - near.value)) / reach).max(0.0);
        Field {
            value: near.value - blend * blend * reach * 0.25,
            gradient: near.gradient * (1.0 - 0.5 * blend) + far.gradient * (0.5 * blend),
        }
    }
}

/// Capsules that share spheres at their ends: a plain union, which is smooth where a row is nearly straight. (A smooth
/// union would make every joint swell.)
pub(super) type Row = Vec<Capsule>;

/// Rows with fillets of one width between them, such as a finger and its pads.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// Reach of the smooth union between the rows, metres.
    pub fillet: f64,
    pub rows: Vec<Row>,
}

/// Groups, with fillets of another width (the webs) between them.
#[derive(Debug, Clone)]
pub(super) struct Flesh {
    pub groups: Vec<Group>,
    /// Reach of the smooth union between the groups, metres.
    pub web: f64,
}

impl Flesh {
    pub(super) fn field(&self, p: DVec3) -> Field {
        let nearest = |row: &Row| {
            let fields = row.iter().map(|capsule| capsule.field(p));
            fields.fold(NOWHERE, |near, field| if field.value < near.value { field } else { near })
        };
        self.groups.iter().fold(NOWHERE, |total, group| {
            let of_group = group.rows.iter().fold(NOWHERE, |sum, row| sum.smooth_union(nearest(row), group.fillet));
            total.smooth_union(of_group, self.web)
        })
    }

    /// One Newton step from `p` to the surface.
    pub(super) fn project(&self, p: DVec3) -> (DVec3, DVec3) {
        let field = self.field(p);
        let squared = field.gradient.length_squared().max(0.05);
        (p - field.gradient * (field.value / squared), field.gradient.normalize_or_zero())
    }
}
