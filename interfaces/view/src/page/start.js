// Everything is there: begin.
expose(0);
paint();
follow();
