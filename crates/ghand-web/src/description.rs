//! What the page knows about a hand, as JSON; `web/ghand-avatar.d.ts` has its types.

use ghand_avatar::PropertyTables;
use ghand_hand_model::joints::limits::JointLimits;
use ghand_hand_model::joints::names::JointRole;
use serde_json::{Value, json};

use crate::hand::Hand;
use crate::layer::Layer;

/// A hand: name, side, joints with the ranges of their angles (radians) if their names identify them, kind of avatar.
pub fn of_hand(hand: &Hand) -> Value {
    let model = hand.model();
    let avatar = hand.avatar();
    let roles = JointRole::of_joints(&model.joint_names);
    let joints = model.joint_names.iter().enumerate().map(|(k, name)| {
        let known = roles.get(k).copied().flatten().filter(|_| hand.angles(k).is_some());
        let limits = known.map(|role| {
            let JointLimits { flexion, abduction, twist } = JointLimits::of(role);
            let range = |range: ghand_hand_model::joints::limits::AngleRange| json!([range.low, range.high]);
            json!({"flexion": range(flexion), "abduction": range(abduction), "twist": range(twist)})
        });
        json!({"name": name, "parent": model.parents.get(k).copied().flatten(), "limits": limits})
    });
    json!({
        "name": model.name,
        "side": model.side.to_string(),
        "joints": joints.collect::<Vec<_>>(),
        "gaussians": avatar.template.len(),
        "baked": matches!(avatar.tables, PropertyTables::Baked(_)),
        "relightable": avatar.light.is_some(),
        "layers": Layer::ALL.into_iter().filter(|layer| layer.is_of(avatar)).map(Layer::name).collect::<Vec<_>>(),
        "capture": avatar.provenance.capture,
    })
}
