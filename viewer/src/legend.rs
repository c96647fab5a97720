//! What the colours mean, for whoever sees a recording for the first time.

/// Beside a drive.
pub(crate) const DRIVE: &str = "\
# What you see

Drag to turn, right-drag to shift, scroll to zoom; space starts and stops.

- **White**: the car. **Black**: its tyres, steered.
- **Yellow ring**: 1.0 m around the body; the safe ratio is its drivable share.
- **Pink square**: the ground the sensor shows (12 m).
- **Dot and arc ahead**: the look-ahead point and the way to it. Blue: the expert's, orange: the network's, green: a \
planner's.
- **Ellipses**: one and two σ of the network's point.
- **Blue dot beside it**: what the expert would have said there; τ̂ is the distance between the two, χ̂ the network's σ, \
both as fractions of the view; the network drives only below the red lines τ and χ.
- **Fan of blue arcs**: the expert's candidates, the better the brighter; blue line: the plan it chose.
- **Green fan or arrows**: a tentacle's paths, the cheaper the brighter, the chosen one white; the field that VVF and APF \
follow, longer where it is stronger.
- **Trail**: the swept path, in the colour of whoever drove; of several drivers each has the colour of its signals.
- **Red dot**: a near-collision. The car is stopped there and put back on the grey path.

Views and grid: light = drivable, dark = not. Where the sensor is **wrong**, the colour says which layer of noise did it: \
orange a ragged boundary, light blue a shadow, yellow a speed bump, red ground taken for road, pink a patch, green a \
stain, violet a flicker, brown a repeated frame.

Obstacles: blue tones are cars, violet vans and trucks, orange cones, yellow bollards, grey curbs and wheel stops, brown \
pillars, brick-red walls, teal carts, pink people.
";

/// Beside a lot.
pub(crate) const LOT: &str = "\
# What you see

Drag to turn, right-drag to shift, scroll to zoom.

- **Grey area**: drivable, as the simulator knows it, obstacles cut out.
- **Light lines**: edge of the lot and of islands. **Ochre**: speed bumps.
- **Grey line**: the reference path from start to finish.

Obstacles: blue tones are cars, violet vans and trucks, orange cones, yellow bollards, grey curbs and wheel stops, brown \
pillars, brick-red walls, teal carts, pink people. Each class is an entity of its own under `lot/obstacles` and can be hidden.
";

#[cfg(test)]
mod tests {
    use super::*;
    use sim::scenario::ObstacleClass;

    /// Walls and wheel stops were drawn and not explained.
    #[test]
    fn every_class_of_obstacle_is_explained() {
        for class in ObstacleClass::ALL {
            let name = match class {
                ObstacleClass::Sedan | ObstacleClass::Suv | ObstacleClass::Compact => "cars",
                ObstacleClass::Van => "vans",
                ObstacleClass::Truck => "trucks",
                ObstacleClass::Cone => "cones",
                ObstacleClass::Bollard => "bollards",
                ObstacleClass::Curb => "curbs",
                ObstacleClass::WheelStop => "wheel stops",
                ObstacleClass::Pillar => "pillars",
                ObstacleClass::Cart => "carts",
                ObstacleClass::Person => "people",
                ObstacleClass::Wall => "walls",
            };
            for legend in [DRIVE, LOT] {
                assert!(legend.contains(name), "{class:?} in {legend}");
            }
        }
    }
}
