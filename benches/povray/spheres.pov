// The same scene as spheres.toml.
#version 3.7;
global_settings { assumed_gamma 1 max_trace_level 13 adc_bailout 1/1024 ambient_light 0 }
background { rgb <0.3, 0.45, 0.75> }
camera { location <0.3, 2.2, 7> right -x*image_width/image_height up y angle 2*degrees(atan(tan(radians(20))*image_width/image_height)) look_at <0.3, 1.1, 0> }
light_source { <-6, 12, 8> rgb 1 }
polygon { 5, <-20, 0, 20>, <20, 0, 20>, <20, 0, -20>, <-20, 0, -20>, <-20, 0, 20>
  pigment { checker rgb <0.8, 0.15, 0.1> rgb <0.85, 0.75, 0.3> translate -0.5*y }
  finish { ambient 0 diffuse 1 } }
sphere { <-0.7, 1.1, 1.6>, 1 pigment { rgbf <1, 1, 1, 1> } interior { ior 1.5 }
  finish { ambient 0 diffuse 0 specular 0.6 roughness 1/200 reflection { 0, 1 fresnel on } conserve_energy } }
sphere { <1.5, 1.3, -0.8>, 1.3 pigment { rgb 1 }
  finish { ambient 0 diffuse 0.1 specular 0.6 roughness 1/200 reflection 0.75 } }
