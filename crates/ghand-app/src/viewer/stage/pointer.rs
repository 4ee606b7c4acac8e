//! What the pointer holds in the view, and the handles that it can take.

use egui::{CursorIcon, Event, Pos2, Ui, Vec2};

use crate::viewer::hand::Hand;
use crate::viewer::hand::handles::{HandleDrag, draw_joint};
use crate::viewer::rendering::screen::Screen;
use crate::viewer::session::settings::Settings;
use crate::viewer::stage::drags::{Drag, Drags};

/// Drags from one frame to the next.
#[derive(Default)]
pub struct Pointer {
    drags: Drags,
    /// The handle that is dragged.
    handle_drag: Option<HandleDrag>,
}

impl Pointer {
    /// The drags in a frame's events. A drag begins at a place in the view, at a handle of the hand if there is one.
    pub fn follow(
        &mut self,
        events: &[Event],
        mut hand: Option<&mut Hand>,
        screen: &Screen,
        in_view: impl Fn(Pos2) -> bool,
    ) -> Vec<Drag> {
        self.drags.follow(events, |pos| {
            let handle = |hand: &mut Hand| {
                let pose = hand.pose.clone();
                hand.handles()?.at(&pose, screen, pos)
            };
            in_view(pos).then(|| hand.as_deref_mut().and_then(handle))
        })
    }

    /// Drags a handle of the hand by an offset in points.
    pub fn drag_handle(&mut self, hand: &mut Hand, landmark: usize, by: Vec2, screen: &Screen) {
        let drag = self.handle_drag.take().filter(|drag| drag.landmark == landmark);
        let pose = hand.pose.clone();
        let Some(mut drag) = drag.or_else(|| Some(hand.handles()?.begin(&pose, landmark))) else { return };
        hand.drag_handle(&mut drag, screen, by);
        self.handle_drag = Some(drag);
    }

    /// Ends the drag of a handle if none is held.
    pub fn release(&mut self) {
        if self.drags.held_handle().is_none() {
            self.handle_drag = None;
        }
    }

    /// Ends the drag of a handle: the hand is another one.
    pub fn forget_hand(&mut self) {
        self.handle_drag = None;
    }

    /// Draws the handles when the pointer is on the hand, and the joint whose slider the user points at.
    pub fn paint_handles(&self, ui: &Ui, hand: &mut Hand, screen: &Screen, settings: &Settings) {
        let held = self.drags.held_handle();
        let painter = ui.painter().with_clip_rect(screen.rect);
        let pose = hand.pose.clone();
        let shape = hand.shape.clone();
        if let Some(joint) = hand.pointed_at().filter(|_| settings.panel_shown) {
            draw_joint(&painter, hand.model(), &shape, &pose, screen, joint);
        }
        let Some(handles) = hand.handles().filter(|_| settings.handles_shown) else { return };
        let on_view = |pos: &Pos2| {
            screen.rect.contains(*pos) && ui.ctx().layer_id_at(*pos).is_none_or(|layer| layer == ui.layer_id())
        };
        let pointer = ui.input(|input| input.pointer.hover_pos()).filter(on_view);
        let hovered = held.or_else(|| handles.at(&pose, screen, pointer?));
        if hovered.is_some() || pointer.is_some_and(|pointer| handles.is_near(&pose, screen, pointer)) {
            handles.draw(&painter, &pose, screen, hovered);
        }
        if hovered.is_some() {
            ui.ctx().set_cursor_icon(if held.is_some() { CursorIcon::Grabbing } else { CursorIcon::Grab });
        }
    }
}
