"""Colours that the colour-blind tell apart, as texts: of quantities, of curves, of numbered things."""
# slow is nearly white, so that the chains stand out; red on blue is safe for the colour-blind
SHADES = ["#f4f8fc", "#9ecae1", "#4292c6", "#08519c", "#08306b"]
CHAINS = "#b2182b"
#: of chains that pull, lighter
PULLS = "#E69F00"
#: of bodies without a quantity
PLAIN = "#dbe7f3"
#: of Okabe and Ito, for curves
LINES = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
#: of subdomains and materials: fills, none of them black so that outlines and chains remain visible
KINDS = ["#56B4E9", "#E69F00", "#009E73", "#F0E442", "#CC79A7", "#0072B2", "#D55E00", "#DDDDDD"]
