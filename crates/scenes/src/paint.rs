//! The appearance of surfaces: albedo as a function of the position (u, v) in a tile; v goes upwards.
//!
//! Every painter adds detail on all scales down to single texels, as real materials have it. Each brick, book
//! or letter looks different from the others. So repetition that confuses matchers (windows, keys, tiles)
//! appears only where a scene is meant to have it.

use super::noise::{Cell, chance, floor, gradient, octaves, scatter, smoothstep, worley};

/// Albedo at (u, v) of a tile.
pub(super) type Painter = fn(f32, f32) -> f32;

/// Wall paint over rough plaster, with dents and dirt.
pub(super) fn plaster(u: f32, v: f32) -> f32 {
    let grain = octaves(u, v, 4, 7, 0.85, 11);
    let dirt = smoothstep(0.5, 1.4, octaves(u, v, 8, 5, 0.7, 12));
    let dent = speckle(u, v, 48, 0.12, 13);
    0.62 + 0.045 * grain - 0.12 * dirt - 0.18 * dent
}

/// Boards with grain, knots and gaps.
pub(super) fn wood(u: f32, v: f32) -> f32 {
    let board = (v * 8.0).floor();
    let shift = chance(board as i32, 0, 21);
    let warp = 0.04 * gradient(u, v, 8, 22);
    let rings = libm::sinf(50.0 * (v + warp + shift) + 9.0 * gradient(u + shift, v, 4, 23));
    let fibre = octaves(u, v * 16.0, 8, 4, 0.8, 24);
    let knot = speckle(u, v, 9, 0.13, 25);
    let edge = ((v * 8.0 - board) - 0.5).abs();
    let gap = smoothstep(0.485, 0.498, edge);
    let tone = 0.32 + 0.12 * shift;
    (tone + 0.05 * rings + 0.06 * fibre - 0.16 * knot) * (1.0 - 0.8 * gap)
}

/// A smooth table top: pale wood with little contrast.
pub(super) fn veneer(u: f32, v: f32) -> f32 {
    let fibre = octaves(u, v * 12.0, 4, 5, 0.85, 31);
    let scratch = smoothstep(0.8, 1.3, gradient(u * 5.0 + v, v * 2.0, 128, 32));
    0.42 + 0.045 * fibre + 0.05 * scratch - 0.12 * speckle(u, v, 24, 0.1, 33)
}

/// Short pile: fine speckle with worn places.
pub(super) fn carpet(u: f32, v: f32) -> f32 {
    let pile = octaves(u, v, 64, 3, 1.0, 41);
    let wear = octaves(u, v, 4, 5, 0.7, 42);
    0.22 + 0.05 * pile + 0.04 * wear + 0.2 * speckle(u, v, 40, 0.08, 43)
}

/// Printed pages: a grid of pages with different contents.
pub(super) fn print(u: f32, v: f32) -> f32 {
    const PAGES: f32 = 6.0;
    let (x, y) = (u * PAGES, v * PAGES);
    let (column, row) = (floor(x), floor(y));
    let (s, t) = (x - column as f32, 1.0 - (y - row as f32)); // pages are read downwards
    let id = scatter(column, row, 51);
    let paper = 0.78 + 0.02 * octaves(u, v, 64, 2, 1.0, 52);
    let margin = s.min(1.0 - s).min(t).min(1.0 - t);
    if margin < 0.04 {
        return paper;
    }
    match id % 6 {
        0 => paper - 0.68 * letters(s, t, 24, 17, id),
        1 => paper - 0.6 * letters(s, t, 36, 26, id),
        2 => mosaic(s, t, 5, id) * (1.0 - letters(s, t * 0.5, 5, 2, id)) + 0.05,
        3 => chart(s, t, paper, id),
        4 => photograph(s, t, id),
        _ => 0.12 + 0.75 * letters(s, t, 7, 5, id) + 0.1 * mosaic(s, t, 9, id),
    }
}

/// A shelf seen from the front: four rows of spines.
pub(super) fn spines(u: f32, v: f32) -> f32 {
    const ROWS: f32 = 4.0;
    const BOOKS: f32 = 26.0;
    let row = (v * ROWS).floor();
    let t = v * ROWS - row;
    // Uneven widths: the borders between books are shifted by up to a third of a book.
    let warped = u * BOOKS + 0.7 * gradient(u, (row + 0.5) / ROWS, 32, 61);
    let book = warped.floor();
    let s = warped - book;
    let id = scatter(book as i32 % BOOKS as i32, row as i32, 62);
    let tone = 0.06 + 0.6 * (id & 0xff) as f32 / 255.0;
    let ink = if tone > 0.35 { -0.3 } else { 0.45 };
    let title = letters(t * 0.9, s, 14 + (id >> 8 & 7) as i32, 2, id);
    let band = f32::from(chance((t * 24.0) as i32, (id & 0xffff) as i32, 63) > 0.86);
    let round = 1.0 - 1.6 * (s - 0.5) * (s - 0.5);
    let gap = smoothstep(0.44, 0.5, (s - 0.5).abs());
    let wear = 0.03 * octaves(u, v, 32, 3, 0.9, 64);
    (tone + ink * title + 0.5 * ink * band + wear) * round * (1.0 - 0.85 * gap)
}

/// Keys that differ only in their letters.
pub(super) fn keyboard(u: f32, v: f32) -> f32 {
    let (x, y) = (u * 16.0, v * 16.0);
    let (column, row) = (floor(x), floor(y));
    let (s, t) = (x - column as f32 - 0.5, y - row as f32 - 0.5);
    let cap = 1.0 - smoothstep(0.36, 0.44, s.abs().max(t.abs()));
    let letter = if s.abs() < 0.2 && t.abs() < 0.25 {
        glyph(s / 0.4 + 0.5, t / 0.5 + 0.5, scatter(column, row, 71))
    } else {
        0.0
    };
    0.03 + 0.09 * cap + 0.5 * letter + 0.01 * gradient(u, v, 128, 72)
}

/// The picture on a monitor: windows with text of several sizes.
pub(super) fn screen(u: f32, v: f32) -> f32 {
    let pane = worley(u, v, 7, 81);
    let id = pane.id;
    let dark = id & 1 == 0;
    let rows = 55 + (id >> 3 & 31) as i32;
    let text = letters(u, 1.0 - v, 2 * rows, rows, id);
    let border = 1.0 - smoothstep(0.0, 0.04, pane.next - pane.near);
    let page = if dark {
        0.08 + 0.6 * text
    } else {
        0.85 - 0.7 * text
    };
    page * (1.0 - border) + 0.4 * border
}

/// Teddy plush: dense tufts.
pub(super) fn fur(u: f32, v: f32) -> f32 {
    let tuft = octaves(u + 0.05 * gradient(u, v, 8, 91), v * 2.0, 16, 4, 0.85, 92);
    let patch = octaves(u, v, 4, 4, 0.7, 93);
    let Cell { near, next, .. } = worley(u, v, 48, 94);
    0.36 + 0.15 * tuft + 0.12 * patch - 0.1 * smoothstep(0.25, 0.0, next - near)
}

/// Woven cloth in a plaid.
pub(super) fn cloth(u: f32, v: f32) -> f32 {
    let stripe = |x: f32, seed| 0.5 * chance((x * 20.0) as i32, 0, seed);
    let weave = 0.04 * octaves(u, v, 64, 2, 1.0, 103);
    0.15 + 0.5 * (stripe(u, 101) + stripe(v, 102)) + weave + 0.05 * octaves(u, v, 4, 4, 0.7, 104)
}

/// Sprayed cabinet paint: almost no texture, only faint stains, scratches and chips.
pub(super) fn paint(u: f32, v: f32) -> f32 {
    let stain = octaves(u, v, 4, 6, 0.75, 111);
    let scratch = smoothstep(0.75, 1.2, gradient(u * 3.0 + 2.0 * v, v, 64, 112))
        * smoothstep(0.2, 0.8, gradient(u, v, 8, 113));
    0.5 + 0.018 * stain - 0.12 * scratch - 0.3 * speckle(u, v, 16, 0.06, 114)
}

/// Linoleum: small chips of similar greys.
pub(super) fn linoleum(u: f32, v: f32) -> f32 {
    let chip = worley(u, v, 64, 121);
    let tone = (chip.id >> 24) as f32 / 255.0 - 0.5;
    0.36 + 0.08 * tone + 0.025 * octaves(u, v, 4, 6, 0.7, 122) - 0.22 * speckle(u, v, 24, 0.08, 123)
}

/// Bare or lacquered sheet metal.
pub(super) fn metal(u: f32, v: f32) -> f32 {
    0.3 + 0.03 * octaves(u * 8.0, v, 16, 4, 0.9, 131) + 0.1 * speckle(u, v, 16, 0.1, 132)
}

/// Bricks in running bond.
pub(super) fn brick(u: f32, v: f32) -> f32 {
    blocks(u, v, 32, 96, 141)
}

/// Large hewn stones in courses.
pub(super) fn stone(u: f32, v: f32) -> f32 {
    let weather = octaves(u, v, 4, 6, 0.8, 151);
    blocks(u, v, 18, 36, 152) + 0.1 + 0.07 * weather
}

/// A rendered house front: coarse plaster with streaks under the sills.
pub(super) fn stucco(u: f32, v: f32) -> f32 {
    let streak = smoothstep(0.1, 0.9, octaves(u * 8.0, v, 4, 4, 0.7, 161));
    plaster(u, v) - 0.13 * streak
}

/// Roof tiles in rows.
pub(super) fn tiles(u: f32, v: f32) -> f32 {
    let row = (v * 40.0).floor();
    let x = u * 40.0 + 0.5 * (row % 2.0);
    let (s, t) = (x - x.floor() - 0.5, v * 40.0 - row);
    let own = chance(floor(x) % 40, row as i32, 171);
    let moss = smoothstep(0.3, 1.0, octaves(u, v, 4, 5, 0.7, 172));
    (0.12 + 0.16 * own + 0.08 * t) * (1.0 - 1.8 * s * s) * (1.0 - 0.4 * moss)
}

/// Asphalt: grit, patches, cracks and oil.
pub(super) fn asphalt(u: f32, v: f32) -> f32 {
    let grit = octaves(u, v, 64, 3, 1.0, 181);
    let repair = worley(u, v, 4, 182);
    let tone = if repair.id.is_multiple_of(4) {
        -0.06
    } else {
        0.0
    };
    let seam = worley(u + 0.01 * octaves(u, v, 16, 3, 0.8, 183), v, 9, 184);
    let crack = 1.0 - smoothstep(0.0, 0.03, seam.next - seam.near);
    let oil = smoothstep(0.5, 1.3, octaves(u, v, 4, 4, 0.6, 185));
    0.24 + tone + 0.055 * grit - 0.12 * crack - 0.08 * oil + 0.03 * octaves(u, v, 4, 5, 0.7, 186)
}

/// Worn road marking.
pub(super) fn marking(u: f32, v: f32) -> f32 {
    0.7 - 0.4 * smoothstep(0.2, 0.7, octaves(u, v, 16, 5, 0.9, 191))
}

/// Paving: square slabs.
pub(super) fn paving(u: f32, v: f32) -> f32 {
    blocks(u, v, 12, 12, 201) + 0.08
}

/// Grass and gravel.
pub(super) fn gravel(u: f32, v: f32) -> f32 {
    let pebble = worley(u, v, 100, 211);
    let tone = (pebble.id >> 24) as f32 / 255.0;
    let grass = smoothstep(0.2, 0.8, octaves(u, v, 4, 6, 0.75, 212));
    let ground = 0.25 + 0.22 * tone - 0.15 * smoothstep(0.4, 0.8, pebble.near);
    ground * (1.0 - grass) + grass * (0.16 + 0.06 * octaves(u, v, 64, 3, 1.0, 213))
}

/// Leaves against the dark inside of a crown.
pub(super) fn leaves(u: f32, v: f32) -> f32 {
    let leaf = worley(u, v, 28, 221);
    let small = worley(u + 0.37, v + 0.11, 60, 222);
    let tone = |cell: &Cell| 0.06 + 0.32 * (cell.id >> 24) as f32 / 255.0;
    let depth = smoothstep(-0.6, 0.9, octaves(u, v, 4, 4, 0.7, 223));
    let shape = 1.0 - smoothstep(0.2, 0.6, leaf.near);
    let below = tone(&small) * (1.0 - smoothstep(0.2, 0.7, small.near));
    (shape * tone(&leaf) + (1.0 - shape) * below) * (0.25 + 0.75 * depth) + 0.01
}

/// Tree bark.
pub(super) fn bark(u: f32, v: f32) -> f32 {
    let ridge = octaves(u * 6.0, v, 8, 5, 0.8, 231);
    0.16 + 0.08 * ridge - 0.08 * smoothstep(0.1, 0.9, octaves(u * 8.0, v, 8, 3, 0.8, 232))
}

/// A window pane: curtains, lamps and reflections behind glass.
pub(super) fn pane(u: f32, v: f32) -> f32 {
    let room = worley(u, v, 10, 241);
    let tone = 0.04 + 0.16 * (room.id >> 24) as f32 / 255.0;
    let curtain = 0.06 * libm::sinf(400.0 * u) * f32::from(room.id.is_multiple_of(4));
    tone + curtain + 0.05 * octaves(u, v, 4, 5, 0.7, 242)
}

/// Courses of blocks, `rows` high and `columns` / 3 to `columns` long, with mortar between.
fn blocks(u: f32, v: f32, rows: i32, columns: i32, seed: u32) -> f32 {
    let wobble = 0.12 * gradient(u, v, 64, seed);
    let y = v * rows as f32 + wobble;
    let row = y.floor();
    let half = columns as f32 / 3.0;
    let shift = chance(row as i32, 1, seed);
    let x = (u + shift) * half + 0.25 * gradient(u, row / rows as f32, 64, seed + 1);
    let (s, t) = (x - x.floor() - 0.5, y - row - 0.5);
    let aspect = half / rows as f32;
    let to_edge = ((0.5 - s.abs()) / aspect).min(0.5 - t.abs());
    let rough = 0.07 * octaves(u, v, 64, 3, 1.0, seed + 2);
    let mortar = 1.0 - smoothstep(0.05, 0.12, to_edge + rough * 0.5);
    let key = (floor(x)).rem_euclid(half as i32);
    let own = chance(key, row as i32, seed + 3);
    let face = 0.2 + 0.2 * own + rough + 0.05 * octaves(u, v, 8, 5, 0.85, seed + 4);
    face + mortar * (0.42 - face) + 0.04 * (t - 0.1) * (1.0 - mortar)
}

/// 1 on letters, 0 beside them: `rows` lines with `columns` letters each over the unit square.
pub(super) fn letters(s: f32, t: f32, columns: i32, rows: i32, seed: u32) -> f32 {
    let (x, y) = (s * columns as f32, t * rows as f32);
    let (column, row) = (floor(x), floor(y));
    let (fx, fy) = ((x - x.floor()) / 0.82, (y - y.floor()) / 0.66);
    let id = scatter(column, row, seed);
    // Spaces between words, ragged right edges, empty lines.
    let end = columns - (scatter(row, 7, seed) % (columns as u32 / 2 + 1)) as i32;
    let no_line = scatter(row, 5, seed).is_multiple_of(9);
    let blank = no_line || column > end || id.is_multiple_of(6);
    if blank || fx >= 1.0 || fy >= 1.0 {
        return 0.0;
    }
    glyph(fx, fy, id)
}

/// A letter of an invented alphabet on a 4 x 5 grid, about half of it ink.
fn glyph(s: f32, t: f32, id: u32) -> f32 {
    let bit = (s * 4.0) as u32 + 4 * (t * 5.0) as u32;
    (id.rotate_left(9) >> bit & 1) as f32
}

/// Patches of flat tone with sharp borders.
pub(super) fn mosaic(s: f32, t: f32, cells: i32, seed: u32) -> f32 {
    0.1 + 0.75 * (worley(s, t, cells, seed).id >> 24) as f32 / 255.0
}

/// Bars on paper, with a caption.
fn chart(s: f32, t: f32, paper: f32, seed: u32) -> f32 {
    let bar = (s * 14.0) as i32;
    let height = 0.15 + 0.6 * chance(bar, 3, seed);
    let inside = t > 0.85 - height && t < 0.85 && s * 14.0 - (bar as f32) < 0.75;
    if inside {
        0.1 + 0.5 * chance(bar, 4, seed)
    } else if !(0.1..0.87).contains(&t) {
        paper - 0.6 * letters(s, t, 30, 22, seed)
    } else {
        paper - 0.15 * f32::from((t * 20.0).fract() < 0.08)
    }
}

/// Hills under a sky, as a photograph on paper.
fn photograph(s: f32, t: f32, seed: u32) -> f32 {
    let relief = octaves(s, t, 4, 6, 0.75, seed);
    let ridge = t - 0.45 - 0.2 * gradient(s, 0.3, 4, seed ^ 1);
    let ground = 0.22 + 0.18 * relief;
    let sky = 0.7 + 0.1 * octaves(s, t, 4, 4, 0.6, seed ^ 2);
    sky + smoothstep(0.0, 0.02, ridge) * (ground - sky)
}

/// 1 in round spots, 0 elsewhere. Spots are up to `size` wide if `cells` is 1; sizes vary.
pub(super) fn speckle(u: f32, v: f32, cells: i32, size: f32, seed: u32) -> f32 {
    let spot = worley(u, v, cells, seed);
    let radius = size * (0.3 + (spot.id % 97) as f32 / 60.0);
    let present = spot.id % 5 < 3;
    f32::from(present) * (1.0 - smoothstep(0.5 * radius, radius, spot.near))
}
