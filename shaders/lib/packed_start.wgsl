// Where a lane's columns of `block` begin in packed weights read as Quads, pasted before the loop over k.
#if W16
    var wpos = block * p.k_packed * 4u + lane;
#else
#if W8
    var wpos = block * p.k_packed * 2u + lane;
#else
    var wpos = block * p.k_packed * 8u + lane;
#endif
#endif
