// What a frame of the splatter counts. Host twin: `ghand_render::splat::Counters`.
struct Counters {
    // Gaussians in the table.
    gaussians: u32,
    // Intersections drawn: those wanted, as far as they fit.
    intersections: atomic<u32>,
    intersections_wanted: atomic<u32>,
    // Gaussians that were dropped because of a number that is not finite, or a quaternion of 0.
    broken: atomic<u32>,
    // Of the tiles with too many Gaussians for the driver, the largest number of Gaussians.
    cut_short: atomic<u32>,
    // Of the Gaussians on too many tiles for the driver, the largest number of tiles.
    too_wide: atomic<u32>,
    // Gaussians with a gradient that is not finite.
    bad_gradients: atomic<u32>,
    padding: u32,
}
