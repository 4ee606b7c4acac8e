// Splats that the lanes of a subgroup have loaded for each other.

import package::shared::splat::Splat;

// The splat that a lane has loaded.
fn splat_of(mine: Splat, lane: u32) -> Splat {
    var splat = Splat();
    splat.mean = subgroupShuffle(mine.mean, lane);
    splat.depth = subgroupShuffle(mine.depth, lane);
    splat.opacity = subgroupShuffle(mine.opacity, lane);
    splat.conic = subgroupShuffle(mine.conic, lane);
    splat.color = subgroupShuffle(mine.color, lane);
    return splat;
}
