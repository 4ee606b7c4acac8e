//! A motion and the current position in it.

use std::sync::Arc;
use std::time::Duration;

use egui::Context;
use ghand_core::{HandModel, Pose};
use ghand_motion::motions::motion;
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_motion::{KeyFrames, PoseSequence};

/// After a longer pause between frames than this, seconds, such as while the window is minimised, the motion continues
/// where it was. A software rasteriser takes about a second for a large picture.
const LONGEST_STEP: f64 = 3.0;
/// Seconds between two pictures of a motion.
const FRAME: f64 = 1.0 / 60.0;
/// Least time that a motion of keys offers, and how much there is after its last key, seconds.
const LEAST_LENGTH: f64 = 4.0;
const ROOM: f64 = 2.0;
/// Title of a motion of keys.
const KEYS: &str = "key frames";

/// What moves.
#[derive(Debug, Clone)]
enum Content {
    /// Poses at a constant rate, shared with the history of edits.
    Recorded(Arc<PoseSequence>),
    /// Key frames at whole frames of [`DEFAULT_FPS`], so that a file of these frames meets them.
    Keyed(KeyFrames),
}

/// A motion and the current position in it.
#[derive(Debug, Clone)]
pub struct Timeline {
    title: String,
    content: Content,
    seconds: f64,
    playing: bool,
    /// How many times faster than in its own time it plays.
    rate: f64,
    /// The part that repeats, seconds; all if there is none.
    range: Option<[f64; 2]>,
    /// When the motion was last advanced, in the user interface's seconds, if it has played since.
    last_step: Option<f64>,
}

impl Timeline {
    /// A motion that plays from its beginning.
    pub fn new(title: String, sequence: PoseSequence) -> Timeline {
        Timeline { playing: true, ..Timeline::with(title, Content::Recorded(Arc::new(sequence))) }
    }

    /// Key frames, at the beginning.
    pub fn of_keys(keys: KeyFrames) -> Timeline {
        Timeline::with(KEYS.into(), Content::Keyed(keys))
    }

    /// Key frames with a title of their own, at the beginning.
    pub fn of_titled_keys(title: String, keys: KeyFrames) -> Timeline {
        Timeline::with(title, Content::Keyed(keys))
    }

    fn with(title: String, content: Content) -> Timeline {
        Timeline { title, content, seconds: 0.0, playing: false, rate: 1.0, range: None, last_step: None }
    }

    /// Its title.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The pose at the motion's current position.
    pub fn pose(&self) -> Option<Pose> {
        match &self.content {
            Content::Recorded(sequence) => sequence.pose_at(self.seconds),
            Content::Keyed(keys) => keys.pose_at(self.seconds),
        }
    }

    /// A motion by name that plays from its beginning; `None` if there is none for this hand.
    pub fn named(name: &str, model: &HandModel) -> Option<Timeline> {
        let sequence = motion(name, model, DEFAULT_FPS)?.ok()?;
        Some(Timeline::new(name.into(), sequence))
    }

    /// The key frames, if it consists of them.
    pub fn keys(&self) -> Option<&KeyFrames> {
        match &self.content {
            Content::Recorded(_) => None,
            Content::Keyed(keys) => Some(keys),
        }
    }

    /// The key frames to change, if it consists of them.
    pub fn keys_mut(&mut self) -> Option<&mut KeyFrames> {
        match &mut self.content {
            Content::Recorded(_) => None,
            Content::Keyed(keys) => Some(keys),
        }
    }

    /// The motion at a constant rate, in a shape; `None` if it has no pose.
    pub fn sequence(&self, joint_names: &[String], shape: &[f64]) -> Option<PoseSequence> {
        match &self.content {
            Content::Recorded(sequence) => Some(sequence.as_ref().clone()),
            Content::Keyed(keys) => keys.sequence(DEFAULT_FPS, joint_names, shape),
        }
    }

    /// The current position, seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Goes to a position and stops there. Between the frames of keys there are no positions.
    pub fn go_to(&mut self, seconds: f64) {
        self.pause();
        self.seconds = self.on_frame(seconds).clamp(0.0, self.length());
    }

    /// The position to which a time belongs, seconds: where a key can be.
    pub fn on_frame(&self, seconds: f64) -> f64 {
        match &self.content {
            Content::Recorded(_) => seconds,
            Content::Keyed(_) => (seconds * DEFAULT_FPS).round() / DEFAULT_FPS,
        }
    }

    /// End of the motion, seconds.
    pub fn end(&self) -> f64 {
        match &self.content {
            Content::Recorded(sequence) => sequence.duration(),
            Content::Keyed(keys) => keys.duration(),
        }
    }

    /// End of the positions, seconds: keys can be added after the last one.
    pub fn length(&self) -> f64 {
        match &self.content {
            Content::Recorded(_) => self.end(),
            Content::Keyed(_) => LEAST_LENGTH.max((self.end() + ROOM).ceil()),
        }
    }

    /// How many times faster than in its own time it plays.
    pub fn rate_mut(&mut self) -> &mut f64 {
        &mut self.rate
    }

    /// The part that repeats, seconds.
    pub fn range(&self) -> [f64; 2] {
        let end = self.end();
        match self.range.map(|range| range.map(|time| time.clamp(0.0, end))) {
            Some([from, to]) if from < to => [from, to],
            _ => [0.0, end],
        }
    }

    /// Repeats only this part; all if it is empty or the whole.
    pub fn set_range(&mut self, [from, to]: [f64; 2]) {
        let is_whole = from <= 0.0 && to >= self.end();
        self.range = (from < to && !is_whole).then_some([from, to]);
    }

    /// Plays on, or stops at the current position.
    pub fn play_or_pause(&mut self) {
        self.playing = !self.playing;
    }

    /// Stops at the current position.
    pub fn pause(&mut self) {
        self.playing = false;
    }

    /// Stops at the beginning.
    pub fn rewind(&mut self) {
        self.pause();
        self.seconds = 0.0;
    }

    /// Whether it plays.
    pub fn is_playing(&self) -> bool {
        self.playing
    }

    /// Advances to the present time if it plays, and returns its pose then.
    pub fn advance(&mut self, context: &Context) -> Option<Pose> {
        if !self.playing {
            self.last_step = None;
            return None;
        }
        self.step_to(context.input(|input| input.time));
        context.request_repaint_after(Duration::from_secs_f64(FRAME));
        self.pose()
    }

    /// Advances to a time of the user interface, seconds; the range repeats.
    fn step_to(&mut self, now: f64) {
        let passed = self.last_step.replace(now).map_or(0.0, |last| now - last);
        if passed > LONGEST_STEP {
            return;
        }
        let [from, to] = self.range();
        self.seconds += passed.max(0.0) * self.rate;
        if self.seconds > to {
            self.seconds = if to > from { from + (self.seconds - from) % (to - from) } else { from };
        }
        self.seconds = self.seconds.max(from);
    }

    #[cfg(test)]
    pub(crate) fn state(&self) -> (f64, bool) {
        (self.seconds, self.playing)
    }
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn a_motion_repeats_and_waits_while_nobody_looks() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let sequence = motion("grasp", &model, 30.0).unwrap().unwrap();
        let end = sequence.duration();
        let mut timeline = Timeline::new("grasp".into(), sequence.clone());
        assert_eq!(timeline.pose().unwrap(), sequence.frames[0].pose);
        // It begins when it is first shown.
        timeline.step_to(50.0);
        assert_eq!(timeline.pose().unwrap(), sequence.frames[0].pose);
        timeline.step_to(50.1);
        assert!((timeline.seconds - 0.1).abs() < 1e-9);
        timeline.step_to(150.0);
        assert!((timeline.seconds - 0.1).abs() < 1e-9);
        timeline.seconds = end - 0.05;
        timeline.step_to(150.1);
        assert!((timeline.seconds - 0.05).abs() < 1e-9);
    }

    #[test]
    fn a_part_repeats_at_the_chosen_rate() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let mut timeline = Timeline::named("grasp", &model).unwrap();
        let end = timeline.end();
        assert_eq!(timeline.range(), [0.0, end]);
        timeline.set_range([0.5, 1.0]);
        *timeline.rate_mut() = 2.0;
        // It enters the part at once, and passes its end after a quarter of a second.
        for (now, expected) in [(10.0, 0.5), (10.1, 0.7), (10.2, 0.9), (10.3, 0.6)] {
            timeline.step_to(now);
            assert!((timeline.seconds() - expected).abs() < 1e-9, "{}", timeline.seconds());
        }
        timeline.set_range([1.0, 1.0]);
        assert_eq!(timeline.range(), [0.0, end]);
    }

    #[test]
    fn keys_are_on_whole_frames_and_leave_room_for_more() {
        let mut timeline = Timeline::of_keys(KeyFrames::default());
        assert_eq!((timeline.pose(), timeline.end(), timeline.length()), (None, 0.0, 4.0));
        timeline.go_to(1.004);
        let seconds = timeline.seconds();
        assert!((seconds - 1.0).abs() < 1e-9);
        let pose = Pose::rest(1);
        timeline.keys_mut().unwrap().set(3.5, pose.clone());
        assert_eq!((timeline.pose(), timeline.end(), timeline.length()), (Some(pose), 3.5, 6.0));
        assert_eq!(timeline.sequence(&["a".into()], &[]).unwrap().frames.len(), 106);
    }
}
