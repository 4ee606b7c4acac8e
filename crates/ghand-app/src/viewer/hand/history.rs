//! Undo and redo.

/// Most states that are remembered; a pose is about half a kilobyte.
const MOST: usize = 500;

/// The states that the user has made, in order.
#[derive(Debug, Clone)]
pub struct History<T> {
    states: Vec<T>,
    /// The present one.
    now: usize,
}

impl<T: Clone + PartialEq> History<T> {
    /// A history that begins with this state.
    pub fn new(state: T) -> History<T> {
        History { states: vec![state], now: 0 }
    }

    /// Remembers the state, if it is another one. What was undone is forgotten then.
    pub fn remember(&mut self, state: &T) {
        if self.states.get(self.now) == Some(state) {
            return;
        }
        self.states.truncate(self.now + 1);
        self.states.push(state.clone());
        let excess = self.states.len().saturating_sub(MOST);
        self.states.drain(..excess);
        self.now = self.states.len() - 1;
    }

    /// The state before `state`, which is remembered; `None` at the beginning.
    pub fn undo(&mut self, state: &T) -> Option<&T> {
        self.remember(state);
        self.now = self.now.checked_sub(1)?;
        self.states.get(self.now)
    }

    /// The state that was undone last; `None` if `state` has changed since.
    pub fn redo(&mut self, state: &T) -> Option<&T> {
        self.remember(state);
        let next = self.states.get(self.now + 1)?;
        self.now += 1;
        Some(next)
    }

    /// Whether there is a state before `state`.
    pub fn can_undo(&self, state: &T) -> bool {
        self.now > 0 || self.states.get(self.now) != Some(state)
    }

    /// Whether there is a state after `state`.
    pub fn can_redo(&self, state: &T) -> bool {
        self.states.get(self.now) == Some(state) && self.now + 1 < self.states.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn undo_and_redo_walk_through_the_states() {
        let mut history = History::new(0.0);
        assert!(!history.can_undo(&0.0) && !history.can_redo(&0.0));
        assert_eq!(history.undo(&0.0), None);
        history.remember(&1.0);
        // The last change need not have been remembered.
        assert!(history.can_undo(&2.0));
        assert_eq!(history.undo(&2.0), Some(&1.0));
        assert_eq!(history.undo(&1.0), Some(&0.0));
        assert_eq!(history.undo(&0.0), None);
        assert_eq!(history.redo(&0.0), Some(&1.0));
        assert!(history.can_redo(&1.0));
        // A new change ends the redo.
        assert_eq!(history.redo(&7.0), None);
        assert_eq!(history.undo(&7.0), Some(&1.0));
    }

    #[test]
    fn only_the_last_states_are_remembered() {
        let mut history = History::new(0.0);
        (0..2000).for_each(|k| history.remember(&f64::from(k)));
        let mut now = 1999.0;
        let mut steps = 0;
        while let Some(before) = history.undo(&now) {
            now = *before;
            steps += 1;
        }
        assert_eq!(steps, MOST - 1);
    }
}
