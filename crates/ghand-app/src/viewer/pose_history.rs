//! Undo and redo of pose changes.

use ghand_core::Pose;

/// Most poses that are remembered; a pose is about half a kilobyte.
const MOST: usize = 500;

/// The poses that the user has made, in order.
#[derive(Debug, Clone)]
pub struct PoseHistory {
    poses: Vec<Pose>,
    /// The present one.
    now: usize,
}

impl PoseHistory {
    /// A history that begins with this pose.
    pub fn new(pose: Pose) -> PoseHistory {
        PoseHistory { poses: vec![pose], now: 0 }
    }

    /// Remembers the pose, if it is another one. What was undone is forgotten then.
    pub fn remember(&mut self, pose: &Pose) {
        if self.poses.get(self.now) == Some(pose) {
            return;
        }
        self.poses.truncate(self.now + 1);
        self.poses.push(pose.clone());
        let excess = self.poses.len().saturating_sub(MOST);
        self.poses.drain(..excess);
        self.now = self.poses.len() - 1;
    }

    /// The pose before `pose`, which is remembered; `None` at the beginning.
    pub fn undo(&mut self, pose: &Pose) -> Option<&Pose> {
        self.remember(pose);
        self.now = self.now.checked_sub(1)?;
        self.poses.get(self.now)
    }

    /// The pose that was undone last; `None` if `pose` has changed since.
    pub fn redo(&mut self, pose: &Pose) -> Option<&Pose> {
        self.remember(pose);
        let next = self.poses.get(self.now + 1)?;
        self.now += 1;
        Some(next)
    }

    /// Whether there is a pose before `pose`.
    pub fn can_undo(&self, pose: &Pose) -> bool {
        self.now > 0 || self.poses.get(self.now) != Some(pose)
    }

    /// Whether there is a pose after `pose`.
    pub fn can_redo(&self, pose: &Pose) -> bool {
        self.poses.get(self.now) == Some(pose) && self.now + 1 < self.poses.len()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn pose(x: f64) -> Pose {
        Pose { translation: DVec3::X * x, ..Pose::rest(1) }
    }

    #[test]
    fn undo_and_redo_walk_through_the_poses() {
        let mut history = PoseHistory::new(pose(0.0));
        assert!(!history.can_undo(&pose(0.0)) && !history.can_redo(&pose(0.0)));
        assert_eq!(history.undo(&pose(0.0)), None);
        history.remember(&pose(1.0));
        // The last change need not have been remembered.
        assert!(history.can_undo(&pose(2.0)));
        assert_eq!(history.undo(&pose(2.0)), Some(&pose(1.0)));
        assert_eq!(history.undo(&pose(1.0)), Some(&pose(0.0)));
        assert_eq!(history.undo(&pose(0.0)), None);
        assert_eq!(history.redo(&pose(0.0)), Some(&pose(1.0)));
        assert!(history.can_redo(&pose(1.0)));
        // A new change ends the redo.
        assert_eq!(history.redo(&pose(7.0)), None);
        assert_eq!(history.undo(&pose(7.0)), Some(&pose(1.0)));
    }

    #[test]
    fn only_the_last_poses_are_remembered() {
        let mut history = PoseHistory::new(pose(0.0));
        (0..2000).for_each(|k| history.remember(&pose(f64::from(k))));
        let mut now = pose(1999.0);
        let mut steps = 0;
        while let Some(before) = history.undo(&now) {
            now = before.clone();
            steps += 1;
        }
        assert_eq!(steps, MOST - 1);
    }
}
