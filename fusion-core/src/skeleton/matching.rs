//! Matching of frames by their timestamps.

/// Returns the entry of `times` for each frame, in s; `None` without one. An entry belongs to the nearest frame if it
/// is within half of the median interval between frames; of several, the nearest entry counts. `frames` increase.
#[must_use]
pub fn matched(times: &[f64], frames: &[f64]) -> Vec<Option<usize>> {
    let reach = half_interval(frames);
    let mut found: Vec<Option<usize>> = vec![None; frames.len()];
    for (entry, &time) in times.iter().enumerate() {
        let Some(frame) = nearest(frames, time) else { break };
        let apart = |entry: usize| (times[entry] - frames[frame]).abs();
        // Without rounding, an entry exactly between two frames of a clock belongs to the earlier one.
        let within = apart(entry) <= reach * (1.0 + 1e-9);
        if within && found[frame].is_none_or(|other| apart(entry) < apart(other)) {
            found[frame] = Some(entry);
        }
    }
    found
}

/// Returns half of the median interval between frames, in s; infinity for fewer than two frames.
#[must_use]
pub fn half_interval(frames: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = frames.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).map_or(f64::INFINITY, |median| 0.5 * median)
}

fn nearest(frames: &[f64], time: f64) -> Option<usize> {
    let after = frames.partition_point(|&frame| frame < time);
    let around = after.saturating_sub(1)..(after + 1).min(frames.len());
    around.min_by(|&a, &b| (frames[a] - time).abs().total_cmp(&(frames[b] - time).abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_belong_to_the_nearest_frame_within_half_a_frame() {
        let frames = [0.0, 0.1, 0.2, 0.5, 0.6];
        assert_eq!(half_interval(&frames), 0.05);
        assert_eq!(matched(&frames, &frames), [Some(0), Some(1), Some(2), Some(3), Some(4)]);
        // 0.04 is nearer to 0 than -0.045; 0.26 is too far from 0.2, and 0.53 from 0.6.
        let found = matched(&[-0.045, 0.04, 0.11, 0.26, 0.53, 9.0], &frames);
        assert_eq!(found, [Some(1), Some(2), None, Some(4), None]);
        assert_eq!(matched(&[], &frames), [None; 5]);
        assert_eq!(matched(&[3.0], &[1.0]), [Some(0)]);
        assert_eq!(matched(&[3.0], &[]), []);
    }
}
