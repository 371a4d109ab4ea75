// hertz.geo with half the contact radius, as Hertz's theory is the limit of a/R = 0, and more elements over it.
a = 0.00025;
n = 16;
s = 4;
Include "hertz.geo";
