// The same scene as mirrors.toml.
#version 3.7;
global_settings { assumed_gamma 1 max_trace_level 13 adc_bailout 1/1024 ambient_light 0 }
background { rgb 0 }
camera { location <2.6, 2.6, 3.6> right -x*image_width/image_height up y angle 2*degrees(atan(tan(radians(30))*image_width/image_height)) look_at <-0.3, 1.1, 0> }
#declare Wall = texture { pigment { rgb <0.7, 0.7, 0.65> } finish { ambient 0 diffuse 1 } }
#declare Glass = texture { pigment { rgb 0 } finish { ambient 0 diffuse 0 reflection 0.85 } }
light_source { <0, 3.6, 2> rgb 0.5 }
light_source { <-2, 3.4, -2> rgb 0.4 }
light_source { <2.4, 3.2, -1.5> rgb 0.3 }
#declare Ball0 = texture { pigment { rgb <0.8, 0.2, 0.15> } finish { ambient 0 diffuse 1 specular 0.4 roughness 1/60 reflection 0.15 } }
#declare Ball1 = texture { pigment { rgb <0.2, 0.6, 0.25> } finish { ambient 0 diffuse 1 specular 0.4 roughness 1/60 reflection 0.15 } }
#declare Ball2 = texture { pigment { rgb <0.2, 0.3, 0.8> } finish { ambient 0 diffuse 1 specular 0.4 roughness 1/60 reflection 0.15 } }
polygon { 5, <-3, 0, 4>, <3, 0, 4>, <3, 0, -4>, <-3, 0, -4>, <-3, 0, 4> texture { Wall } }
polygon { 5, <-3, 4, 4>, <-3, 4, -4>, <3, 4, -4>, <3, 4, 4>, <-3, 4, 4> texture { Wall } }
polygon { 5, <-3, 0, -4>, <3, 0, -4>, <3, 4, -4>, <-3, 4, -4>, <-3, 0, -4> texture { Wall } }
polygon { 5, <-3, 0, 4>, <-3, 4, 4>, <3, 4, 4>, <3, 0, 4>, <-3, 0, 4> texture { Wall } }
polygon { 5, <-3, 0, 4>, <-3, 0, -4>, <-3, 4, -4>, <-3, 4, 4>, <-3, 0, 4> texture { Glass } }
polygon { 5, <3, 0, 4>, <3, 4, 4>, <3, 4, -4>, <3, 0, -4>, <3, 0, 4> texture { Glass } }
sphere { <-1.4, 0.4, -1.6>, 0.35 texture { Ball0 } }
sphere { <-1.4, 0.4, -0.4>, 0.35 texture { Ball1 } }
sphere { <-1.4, 0.4, 0.8>, 0.35 texture { Ball2 } }
sphere { <-1.4, 1.3, -1.6>, 0.35 texture { Ball0 } }
sphere { <-1.4, 1.3, -0.4>, 0.35 texture { Ball1 } }
sphere { <-1.4, 1.3, 0.8>, 0.35 texture { Ball2 } }
sphere { <-1.4, 2.2, -1.6>, 0.35 texture { Ball0 } }
sphere { <-1.4, 2.2, -0.4>, 0.35 texture { Ball1 } }
sphere { <-1.4, 2.2, 0.8>, 0.35 texture { Ball2 } }
sphere { <-0.3, 0.4, -1.6>, 0.35 texture { Ball0 } }
sphere { <-0.3, 0.4, -0.4>, 0.35 texture { Ball1 } }
sphere { <-0.3, 0.4, 0.8>, 0.35 texture { Ball2 } }
sphere { <-0.3, 1.3, -1.6>, 0.35 texture { Ball0 } }
sphere { <-0.3, 1.3, -0.4>, 0.35 texture { Ball1 } }
sphere { <-0.3, 1.3, 0.8>, 0.35 texture { Ball2 } }
sphere { <-0.3, 2.2, -1.6>, 0.35 texture { Ball0 } }
sphere { <-0.3, 2.2, -0.4>, 0.35 texture { Ball1 } }
sphere { <-0.3, 2.2, 0.8>, 0.35 texture { Ball2 } }
sphere { <0.8, 0.4, -1.6>, 0.35 texture { Ball0 } }
sphere { <0.8, 0.4, -0.4>, 0.35 texture { Ball1 } }
sphere { <0.8, 0.4, 0.8>, 0.35 texture { Ball2 } }
sphere { <0.8, 1.3, -1.6>, 0.35 texture { Ball0 } }
sphere { <0.8, 1.3, -0.4>, 0.35 texture { Ball1 } }
sphere { <0.8, 1.3, 0.8>, 0.35 texture { Ball2 } }
sphere { <0.8, 2.2, -1.6>, 0.35 texture { Ball0 } }
sphere { <0.8, 2.2, -0.4>, 0.35 texture { Ball1 } }
sphere { <0.8, 2.2, 0.8>, 0.35 texture { Ball2 } }
