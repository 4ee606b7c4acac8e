//! What is shown, without a device: hands, the view, the light.

use ghand_avatar::framing::posed_vertices;
use ghand_avatar::orbit_camera::{OrbitCamera, ViewPoint};
use ghand_avatar::view_side::ViewSide;
use ghand_avatar::{Avatar, Light};
use ghand_core::{Camera, Side};
use ghand_motion::live::LiveOptions;
use glam::DVec3;

use crate::hand::Hand;
use crate::layer::Layer;

/// Hands stand this part of the larger one's width apart.
const GAP: f64 = 0.15;

/// The light on the hands.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LightChoice {
    /// Each avatar's own, that of its capture.
    #[default]
    Capture,
    /// A studio.
    Studio,
}

/// Hands, the view, the light.
#[derive(Default)]
pub struct Stage {
    hands: Vec<Hand>,
    /// None without a hand.
    orbit: Option<OrbitCamera>,
    light: LightChoice,
    /// How far the light is turned about the vertical, radians.
    turn: f64,
    /// What the colours of all hands show.
    layer: Layer,
}

impl Stage {
    /// Adds a hand beside the others, faces all of them, and returns its number. Where it lacks the layer that is shown, all
    /// show skin.
    ///
    /// # Errors
    /// One sentence if one scene cannot show it with the others.
    pub fn add(&mut self, avatar: Avatar) -> Result<usize, String> {
        if let Some(first) = self.hands.first()
            && first.avatar().config.filter() != avatar.config.filter()
        {
            return Err(
                "the avatars were trained with different antialiasing, so one scene cannot show both; train one \
                        of them again"
                    .into(),
            );
        }
        if !self.layer.is_of(&avatar) {
            self.show(Layer::Skin)?;
        }
        let mut hand = Hand::new(avatar);
        hand.show(self.layer)?;
        self.hands.push(hand);
        self.arrange();
        self.face();
        Ok(self.hands.len() - 1)
    }

    /// Removes all hands.
    pub fn clear(&mut self) {
        self.hands.clear();
        self.orbit = None;
    }

    /// The hands.
    pub fn hands(&self) -> &[Hand] {
        &self.hands
    }

    /// A hand, mutable.
    ///
    /// # Errors
    /// One sentence if it does not exist.
    pub fn hand_mut(&mut self, number: usize) -> Result<&mut Hand, String> {
        let count = self.hands.len();
        self.hands.get_mut(number).ok_or_else(|| format!("there is no hand {number}; there are {count}, from 0"))
    }

    /// A hand.
    ///
    /// # Errors
    /// As [`Stage::hand_mut`].
    pub fn hand(&self, number: usize) -> Result<&Hand, String> {
        let count = self.hands.len();
        self.hands.get(number).ok_or_else(|| format!("there is no hand {number}; there are {count}, from 0"))
    }

    /// Puts the hands beside each other as the first one's back is seen, left hands left: thumbs point to each other.
    fn arrange(&mut self) {
        let Some(first) = self.hands.first() else { return };
        let across =
            OrbitCamera::facing(first.model(), first.pose(), &first.model().vertices).camera([1, 1]).rotation.row(0);
        let extents: Vec<[f64; 2]> = (self.hands.iter())
            .map(|hand| {
                let places = hand.model().vertices.iter().map(|v| v.dot(across));
                places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
            })
            .collect();
        let widest = extents.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        let mut order: Vec<usize> = (0..self.hands.len()).collect();
        order.sort_by_key(|k| self.hands[*k].model().side == Side::Right);
        let mut edge = extents[order[0]][0];
        for k in order {
            let [low, high] = extents[k];
            self.hands[k].place = across * (edge - low);
            edge += high - low + GAP * widest;
        }
    }

    /// Lets `seconds` pass; says whether a pose has changed.
    pub fn advance(&mut self, seconds: f64) -> bool {
        self.hands.iter_mut().fold(false, |changed, hand| hand.advance(seconds) | changed)
    }

    /// Whether a pose changes with time now.
    pub fn is_moving(&self) -> bool {
        self.hands.iter().any(Hand::is_moving)
    }

    /// Gives a packet of live poses to the hands; with hands of both sides, each takes its own.
    ///
    /// # Errors
    /// One sentence if no hand can use it.
    pub fn take_packet(&mut self, packet: &[u8], seconds: f64, in_place: bool) -> Result<(), String> {
        let has = |side: Side| self.hands.iter().any(|hand| hand.model().side == side);
        let options = LiveOptions { in_place, own_side_only: has(Side::Left) && has(Side::Right), smooth: None };
        let mut result = Err("there is no hand to drive".into());
        for hand in &mut self.hands {
            let taken = hand.take_packet(packet, seconds, &options);
            if result.is_err() {
                result = taken;
            }
        }
        result
    }

    /// All points of the hands in their poses, metres, world.
    fn points(&self) -> Vec<DVec3> {
        let points = |hand: &Hand| {
            let vertices = posed_vertices(hand.model(), hand.pose());
            vertices.into_iter().map(|v| v + hand.place).collect::<Vec<_>>()
        };
        self.hands.iter().flat_map(points).collect()
    }

    /// Faces the hands: their backs and a little of the thumb's side of the first.
    pub fn face(&mut self) {
        let points = self.points();
        self.orbit = self.hands.first().map(|hand| OrbitCamera::facing(hand.model(), hand.pose(), &points));
    }

    /// Moves the view, without turning it, so that the hands fill the picture.
    pub fn frame(&mut self) {
        let points = self.points();
        self.orbit.iter_mut().for_each(|orbit| orbit.frame(&points));
    }

    /// Turns the view to a side of the first hand.
    pub fn look_from(&mut self, side: ViewSide) {
        if let (Some(orbit), Some(hand)) = (&mut self.orbit, self.hands.first()) {
            orbit.look_from(side, hand.model(), hand.pose());
        }
    }

    /// The view; none without a hand.
    pub fn orbit_mut(&mut self) -> Option<&mut OrbitCamera> {
        self.orbit.as_mut()
    }

    /// Where the view is taken from; none without a hand.
    pub fn view_point(&self) -> Option<ViewPoint> {
        self.orbit.as_ref().map(OrbitCamera::view_point)
    }

    /// Looks from a position to a target (metres, world), `up` upwards in the picture, with a field of view along the
    /// shorter edge, radians.
    ///
    /// # Errors
    /// One sentence if these are no view.
    pub fn look_at(&mut self, position: DVec3, target: DVec3, up: DVec3, field_of_view: f64) -> Result<(), String> {
        let Some(orbit) = &mut self.orbit else { return Err("there is no hand to look at".into()) };
        let problem = "the camera needs a position other than its target, an up that is not along the view, a field of \
                       view from 1 to 170 degrees, and finite numbers";
        let offset = position - target;
        let view = offset.try_normalize().and_then(|back| {
            let up = up.reject_from_normalized(back).try_normalize()?;
            let projection = orbit.projection();
            let distance = offset.length();
            Some(ViewPoint { target, distance, yaw: 0.0, pitch: 0.0, up, back, field_of_view, projection })
        });
        match view.filter(ViewPoint::is_usable) {
            Some(view) => {
                orbit.take(&view);
                Ok(())
            }
            None => Err(problem.into()),
        }
    }

    /// The camera of a picture of this size, pixels; none without a hand.
    pub fn camera(&self, size: [u32; 2]) -> Option<Camera> {
        self.orbit.as_ref().map(|orbit| orbit.camera(size))
    }

    /// Puts the hands into a light, turned about the vertical by an angle, radians.
    ///
    /// # Errors
    /// One sentence if the light of an avatar's capture is part of its colours. Nothing is changed then.
    pub fn set_light(&mut self, light: LightChoice, turn: f64) -> Result<(), String> {
        let is_own = light == LightChoice::Capture && turn == 0.0;
        if !is_own && let Some(number) = self.hands.iter().position(|hand| hand.avatar().light.is_none()) {
            return Err(format!(
                "hand {number} keeps its light: the avatar's colours contain the light of its capture; train it again \
                 with `train --set light=transfer`"
            ));
        }
        if !turn.is_finite() {
            return Err("the light's turn is not finite".into());
        }
        self.light = light;
        self.turn = turn;
        Ok(())
    }

    /// Shows a layer of all hands.
    ///
    /// # Errors
    /// One sentence if an avatar lacks it. Nothing is changed then.
    pub fn show(&mut self, layer: Layer) -> Result<(), String> {
        if let Some(hand) = self.hands.iter_mut().find(|hand| !layer.is_of(hand.avatar())) {
            return hand.show(layer);
        }
        self.layer = layer;
        self.hands.iter_mut().try_for_each(|hand| hand.show(layer))
    }

    /// What the colours show.
    pub fn layer(&self) -> Layer {
        self.layer
    }

    /// The light on a hand; `None` if it is part of its colours, or the layer has none.
    pub fn light_on(&self, hand: &Hand) -> Option<Light> {
        let own = &hand.shown().light.as_ref()?.light;
        let light = match self.light {
            LightChoice::Capture => own.clone(),
            LightChoice::Studio => Light::studio(),
        };
        Some(if self.turn == 0.0 { light } else { light.turned(self.turn) })
    }
}
