// The derivative of the sigmoid s of x. Not s (1 - s): where s is almost 1, few digits of 1 - s are left.
fn sigmoid_slope(x: f32) -> f32 {
    let e = exp(-abs(x));
    return e / ((1.0 + e) * (1.0 + e));
}
