// Rows of the `gaussians` table, which holds one row of N numbers for each property.
const ROW_MEAN: u32 = 0u;
const ROW_SCALE: u32 = 3u;
const ROW_COLOR: u32 = 4u;
