//! Pictures of the frames, drawn while the run continues, on a second thread where there is one.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use energy_dsl::Vector3;

use super::RunError;
use super::frame_store::Frame;
use crate::output::{Framing, Look, OutputFolder, Scenery};

/// Time between two looks at a drawing thread that finishes.
const POLL: Duration = Duration::from_millis(5);
/// Draws the pictures of frames in the order in which they are added. All of them show the same part of space.
#[derive(Debug)]
pub(super) struct FramePictures {
    hands: Hands,
    abandoned: Arc<AtomicBool>,
}

#[derive(Debug)]
enum Hands {
    /// A second thread draws. Both fields are `None` once it was joined.
    Second { frames: Option<Sender<Frame>>, thread: Option<JoinHandle<Result<(), RunError>>> },
    /// The only thread draws, after the last step.
    Only(Box<Drawing>),
}

impl FramePictures {
    /// Starts to draw frames, `frames_per_second` of them per simulated second, on a second thread if `threads` allows
    /// it.
    pub(super) fn start(scenery: Scenery, folder: OutputFolder, frames_per_second: f64, threads: usize) -> Self {
        let abandoned = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&abandoned);
        let drawing = Drawing {
            scenery,
            folder,
            frames_per_second,
            frames: Vec::new(),
            drawn: Vec::new(),
            outermost: Vec::new(),
            framing: None,
        };
        let hands = if threads > 1 {
            let (sender, receiver) = channel();
            let thread = std::thread::spawn(move || drawing.draw_received(&receiver, &stop));
            Hands::Second { frames: Some(sender), thread: Some(thread) }
        } else {
            Hands::Only(Box::new(drawing))
        };
        Self { hands, abandoned }
    }

    /// Adds a frame. Returns the error of an earlier frame, if there was one.
    pub(super) fn add(&mut self, frame: Frame) -> Result<(), RunError> {
        match &mut self.hands {
            Hands::Only(drawing) => drawing.add(frame),
            Hands::Second { frames, thread } => {
                let sent = frames.as_ref().is_some_and(|frames| frames.send(frame).is_ok());
                if !sent {
                    return joined(thread);
                }
            }
        }
        Ok(())
    }

    /// Draws what is left. Stops early once `is_abandoned` returns `true`.
    pub(super) fn finish(&mut self, is_abandoned: impl Fn() -> bool) -> Result<(), RunError> {
        match &mut self.hands {
            Hands::Only(drawing) => {
                while !is_abandoned() && drawing.draw_next()? {}
                Ok(())
            }
            Hands::Second { frames, thread } => {
                drop(frames.take());
                while thread.as_ref().is_some_and(|thread| !thread.is_finished()) {
                    if is_abandoned() {
                        self.abandoned.store(true, Ordering::Relaxed);
                    }
                    std::thread::sleep(POLL);
                }
                joined(thread)
            }
        }
    }
}

impl Drop for FramePictures {
    /// Lets the thread end after its current picture.
    fn drop(&mut self) {
        self.abandoned.store(true, Ordering::Relaxed);
        if let Hands::Second { frames, thread } = &mut self.hands {
            drop(frames.take());
            // An error was reported by `add` or `finish`, or the run failed for another reason.
            let _ = thread.take().map(JoinHandle::join);
        }
    }
}

fn joined(thread: &mut Option<JoinHandle<Result<(), RunError>>>) -> Result<(), RunError> {
    match thread.take().map(JoinHandle::join) {
        Some(Ok(result)) => result,
        Some(Err(panic)) => std::panic::resume_unwind(panic),
        None => Ok(()),
    }
}

/// The frames, and which of their pictures show the part of space that all of them need.
#[derive(Debug)]
struct Drawing {
    scenery: Scenery,
    folder: OutputFolder,
    frames_per_second: f64,
    frames: Vec<Frame>,
    /// Whether the picture of each frame exists and has the current framing.
    drawn: Vec<bool>,
    /// The outermost points of all frames, in m.
    outermost: Vec<Vector3<f64>>,
    /// The part of space that the pictures show; `None` before the first frame.
    framing: Option<Framing>,
}

impl Drawing {
    /// Draws frames as they arrive, and older ones again while none arrives.
    fn draw_received(mut self, frames: &Receiver<Frame>, stop: &AtomicBool) -> Result<(), RunError> {
        while !stop.load(Ordering::Relaxed) {
            match frames.try_recv() {
                Ok(frame) => {
                    self.add(frame);
                    self.draw(self.frames.len() - 1)?;
                }
                Err(TryRecvError::Disconnected) if !self.draw_next()? => break,
                Err(TryRecvError::Disconnected) => {}
                Err(TryRecvError::Empty) if self.draw_next()? => {}
                Err(TryRecvError::Empty) => std::thread::sleep(POLL),
            }
        }
        Ok(())
    }

    /// Adds a frame. If it leaves the part of space that is shown, that part grows, and all pictures are drawn again.
    /// The space that the camera leaves around everything makes that rare.
    fn add(&mut self, frame: Frame) {
        let time = self.time(self.frames.len());
        let outermost = self.scenery.outermost(&frame, time);
        let is_shown = self.framing.is_some_and(|framing| framing.shows(&outermost));
        self.outermost.extend(outermost);
        if !is_shown {
            self.framing = Some(Framing::steady(&self.outermost, self.scenery.floor(time), self.scenery.style()));
            self.drawn.fill(false);
        }
        self.frames.push(frame);
        self.drawn.push(false);
    }

    fn time(&self, frame: usize) -> f64 {
        frame as f64 / self.frames_per_second
    }

    /// Draws the first frame that has no valid picture. Returns `false` if all have one.
    fn draw_next(&mut self) -> Result<bool, RunError> {
        match self.drawn.iter().position(|drawn| !drawn) {
            Some(frame) => self.draw(frame).map(|()| true),
            None => Ok(false),
        }
    }

    fn draw(&mut self, number: usize) -> Result<(), RunError> {
        let Some(framing) = self.framing else { return Ok(()) };
        let positions = &self.frames[number];
        let picture = self.scenery.picture(positions, self.time(number), &framing, &Look::default())?;
        self.folder.write_frame(number, "png", &picture)?;
        self.drawn[number] = true;
        Ok(())
    }
}
