//! Whether the tasks in a file of records are some that a run records.

use crate::counted::counted;

/// A pair and a repetition of it, and the line on which it stands.
pub(crate) type TaskLine = ([u32; 3], usize);

/// Whether no task, a pair and a repetition of it, stands in two lines, none without the repetition before it, and
/// every pair in the `planned` number of repetitions. Only the pair that was recorded last may have fewer, so that a
/// few lines do not stand for millions of results that are missing.
///
/// # Errors
/// The line, and what is wrong with it and what to do.
pub(crate) fn check_tasks(mut lines: Vec<TaskLine>, planned: usize) -> Result<(), (usize, String)> {
    lines.sort_unstable();
    let mut before = None;
    for &(task, line) in &lines {
        let [a, b, repetition] = task;
        if let Some((same, first)) = before
            && same == task
        {
            return Err((line, is_twice((a, b), first)));
        }
        // A run does them in their order, so a number stands for that many records.
        let follows = |(other, earlier)| other == [a, b, repetition - 1] && earlier < line;
        if repetition > 0 && !before.is_some_and(follows) {
            let problem = format!(
                "repetition {repetition} of the pair {a} {b} without the one before it; delete this line"
            );
            return Err((line, problem));
        }
        before = Some((task, line));
    }
    let last = lines.iter().map(|&(_, line)| line).max();
    for pair in lines.chunk_by(|(task, _), (next, _)| task[..2] == next[..2]) {
        let ([a, b, repetition], line) = pair[pair.len() - 1];
        if pair.len() > planned {
            let planned = counted(planned, "planned repetition");
            let problem = format!("repetition {repetition} of the pair {a} {b}, of {planned}");
            return Err((line, format!("{problem} from 0 on; delete this line")));
        }
        if pair.len() < planned && Some(line) != last {
            let planned = counted(planned, "planned repetition");
            let problem = format!(
                "the pair {a} {b} ends here after {} of {planned}",
                pair.len()
            );
            return Err((line, format!("{problem}; delete its lines")));
        }
    }
    Ok(())
}

/// Says that a pair stands in two lines, and on which one first.
pub(crate) fn is_twice((a, b): (u32, u32), first: usize) -> String {
    format!(
        "pair {a} {b} is there twice, first on line {first}; delete the one that does not count"
    )
}
