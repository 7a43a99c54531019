// The same scene as glass.toml.
#version 3.7;
global_settings { assumed_gamma 1 max_trace_level 13 adc_bailout 1/1024 ambient_light 0 }
background { rgb <0.8, 0.85, 0.9> }
camera { location <0, 3, 7> right -x*image_width/image_height up y angle 2*degrees(atan(tan(radians(18))*image_width/image_height)) look_at <0, 0.9, 0> }
light_source { <-5, 9, 6> rgb 0.7 }
light_source { <6, 7, 3> rgb 0.4 }
#declare Clear = texture { pigment { rgbf <0.92, 0.92, 0.92, 1> } finish { ambient 0 diffuse 0 specular 0.5 roughness 1/150 reflection 0.08 } }
// Above 1000 the fade is exponential: exp(-(1 - fade_color) d / fade_distance).
#declare Green = interior { ior 1.5 fade_power 1001 fade_distance 1 fade_color <0.1, 0.85, 0.5> }
#declare Amber = interior { ior 1.33 fade_power 1001 fade_distance 1 fade_color <0.95, 0.7, 0.1> }
polygon { 5, <-20, 0, 20>, <20, 0, 20>, <20, 0, -20>, <-20, 0, -20>, <-20, 0, 20>
  pigment { checker rgb <0.75, 0.75, 0.75> rgb <0.15, 0.2, 0.3> translate -0.5*y }
  finish { ambient 0 diffuse 1 } }
box { <-2.6, 0.01, -1>, <-0.9, 1.9, -0.6> texture { Clear } interior { Green } }
difference { sphere { <0.4, 1, 0>, 0.99 } sphere { <0.4, 1, 0>, 0.45 texture { pigment { rgbf <0.92, 0.92, 0.92, 1> } finish { ambient 0 diffuse 0 reflection 0.08 } } } texture { Clear } interior { Amber } }
box { <1.7, 0.01, -0.3>, <2.7, 1.01, 0.7> texture { Clear } interior { Green } }
