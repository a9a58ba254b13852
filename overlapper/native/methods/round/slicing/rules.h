#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

namespace overlapper::slicing {

/// A node x < 0 of a rule of Gauss and Legendre with n nodes, and θ = π/2 (1 + x). The node at -x has the same numbers,
/// but those for odd coefficients are negated. Computed with mpmath.
struct Node {
  double fraction;            ///< (1 + x) / 2
  double share;               ///< sin²(θ/2): the fraction of the interval below the node
  double weight;              ///< of the slice, for an interval of length 1
  double sine;                ///< sin θ
  double last, last_but_one;  ///< its terms in the coefficients n − 1 and n − 2 of the Legendre series
  double even, odd;           ///< its terms in the coefficients n / 2 and n / 2 − 1; n is a multiple of four
};
// clang-format off
inline constexpr std::array<Node, 4> kNodes8{{
    {0.019855071751231884, 0.0009723930747465951, 0.004956013807543283, 0.06233610595649298, -0.11769245644771356, 0.2098921910670323, 0.29030541733775395, -0.2740188228304149},
    {0.10166676129318664, 0.025287307850590565, 0.054841235667607575, 0.3139927382106792, 0.3778969370845921, -0.5591073831433646, -0.24289619147803757, -0.053756356443960325},
    {0.2372337950418355, 0.13255503062228385, 0.16709469807274444, 0.6781863887723175, -0.6317745531190048, 0.6166048635025358, -0.46158532259653046, 0.4671207500358303},
    {0.4082826787521751, 0.3579160380490356, 0.27310805245210357, 0.9587745256447251, 0.7849065579218132, -0.26738967142620357, 0.41417609673681405, 0.32968848669588297},
}};
inline constexpr std::array<Node, 8> kNodes16{{
    {0.005299532504175033, 6.929546966908637e-05, 0.00035503112097767017, 0.016648203243229548, -0.03278130486396174, 0.06270545045312347, 0.15058800145020093, -0.14740575972423792},
    {0.02771248846338371, 0.00189372306883215, 0.004251385094079633, 0.08695140899998625, 0.1122209124505884, -0.20493540387013992, -0.10847571647570407, 0.025281105530178673},
    {0.06718439880608412, 0.011095931029013096, 0.015657646148953673, 0.20950237558187715, -0.21159853063188444, 0.3541214949557947, -0.27282166214653136, 0.292586524485687},
    {0.12229779582249849, 0.03645255560584376, 0.03668930032305557, 0.37482671620708485, 0.31691961779722083, -0.46284478766452636, 0.1895693337450734, 0.05269404819587083},
    {0.19106187779867811, 0.08739956378658222, 0.06636434224332013, 0.5648393755272285, -0.41664037702596135, 0.49770223675171826, 0.3211314759255782, -0.35201317927912984},
    {0.2709916111713863, 0.17051405730045766, 0.09992938781207442, 0.7521675705941965, 0.5008933497159644, -0.4435406121078921, -0.2559042813894806, -0.16501933751603287},
    {0.35919822461037054, 0.28597146820556574, 0.12961280457896754, 0.9037517083312625, -0.5617461448292791, 0.305833437439604, -0.32830696857627284, 0.3414173736623772},
    {0.4524937450811813, 0.4256540670547978, 0.14714010267857136, 0.988883577079744, 0.5936159289428018, -0.10904181595768207, 0.30421981746713633, 0.2717959571544673},
}};
inline constexpr std::array<Node, 12> kNodes24{{
    {0.00240639000148932, 1.4287943182011783e-05, 7.327571601569155e-05, 0.00755982513995963, -0.015074422043108972, 0.029351489020715417, 0.10150925819667533, -0.10025190784166031},
    {0.012635722014345251, 0.0003938971595899967, 0.0008893007537826567, 0.039685866734527224, 0.05225186613570152, -0.09964836396246231, -0.06873805069573369, 0.030606001998891554},
    {0.030862723998633622, 0.002348378028467179, 0.0033664783772112974, 0.09680626320858773, -0.10078656328461252, 0.18501939296171394, -0.18957472949225282, 0.20182229812545555},
    {0.056792236497799485, 0.007937163319033949, 0.008265449094038245, 0.1774729811264907, 0.15608887413910497, -0.2707035684056185, 0.1174497162931925, -0.003804099433388402},
    {0.08999900701304854, 0.019852721999046002, 0.016071442592121454, 0.27898811034361015, -0.21465007688006033, 0.34437421825650083, 0.23506230633227274, -0.2611955292245529},
    {0.12993790421072282, 0.041083958148993106, 0.02687224824024659, 0.39696884780448394, 0.273384265122517, -0.395879298679761, -0.15959948041355967, -0.047927981514031666},
    {0.17595317403151223, 0.07446413498096881, 0.040255283030036906, 0.5250494360819936, -0.32949021039193754, 0.41779665729859544, -0.2597555657954904, 0.2919797934483577},
    {0.22728926430558022, 0.12214222419855339, 0.055264739761756845, 0.6548999962326575, 0.3804443849065234, -0.4059832229947917, 0.1966314065314693, 0.11122580634829161},
    {0.2831032461869774, 0.18505901057631888, 0.07045979452940064, 0.7766908604607956, -0.4240372347791966, 0.3598916075978801, 0.26900217397948084, -0.29589202305082996},
    {0.3424786601519183, 0.26254230538810935, 0.08409560050528943, 0.8800314614139794, 0.4584224693630116, -0.282566041006413, -0.22762295528842091, -0.1758949494670128},
    {0.40444056626319186, 0.35214015559282785, 0.09441219942671737, 0.9552747592434061, -0.48216589541230115, 0.18029543451965438, -0.26547582192752966, 0.2749481630697655},
    {0.4679715535686972, 0.44977468483151917, 0.09997418797338287, 0.9949420439728673, 0.4942866471300963, -0.06194830460601351, 0.2511117422798965, 0.23299835560593826},
}};
inline constexpr std::array<Node, 16> kNodes32{{
    {0.0013680690752592183, 4.618012853660538e-06, 2.3691772536610374e-05, 0.0042979025245427896, -0.008621599840611949, 0.016918664744985237, 0.07653562302384298, -0.07587534640612074},
    {0.007194244227365833, 0.0001277002127126434, 0.00028886358798179817, 0.0225994606456275, 0.030018067051679857, -0.058217912866737984, -0.050117586762085706, 0.02836883763677216},
    {0.017618872206246784, 0.0007657466064386043, 0.0011033012250881195, 0.05532305987825808, -0.05836918647542751, 0.11080824735649403, -0.14476284381507445, 0.15269155902785378},
    {0.03254696203113015, 0.0026114532738992597, 0.002747617352659731, 0.10207122191288788, 0.09146549132612172, -0.16826484704337843, 0.08409533197725139, -0.018856916158590496},
    {0.05183942211697394, 0.006616067863733575, 0.005454893729225398, 0.16213939076925196, -0.12775577180410586, 0.22532652462560163, 0.18313328851595229, -0.2016854455673743},
    {0.07531619313371501, 0.013931226131313841, 0.009389053207986784, 0.23441115220733028, 0.16592934543535495, -0.2773237336457651, -0.11348229783829158, -0.0075105772415547155},
    {0.1027581020160288, 0.025828366490137717, 0.014621990150482817, 0.31724603685208647, -0.20479935229863133, 0.32017083149630793, -0.20813321769788612, 0.23509336890500016},
    {0.13390894062985517, 0.04359577355567662, 0.021112290764035695, 0.4083879630143807, 0.2432643149470776, -0.3504819572078465, 0.14028509567627698, 0.04379861155627362},
    {0.1684778665348924, 0.06841681322276813, 0.028689660344079944, 0.5049196090120049, -0.28029835373680273, 0.36570526467693665, 0.2237017382326695, -0.25456482543059633},
    {0.20614212137961885, 0.1012374202330207, 0.037049790292287985, 0.6032856868104314, 0.31495372174003294, -0.3642354570697622, -0.16462164150031053, -0.08552145758714383},
    {0.2465500455338853, 0.14263551420173415, 0.04576396274643532, 0.6994015278511795, -0.34636890819891397, 0.3454850467549064, -0.23159382609116075, 0.26058595731522394},
    {0.2893243619346823, 0.19270858069409452, 0.05430600590651314, 0.7888522893950735, 0.37377902811804037, -0.30990414515460324, 0.18613802255624412, 0.12884531131812157},
    {0.33406569885893617, 0.25099693392098293, 0.06209638439180038, 0.8671735076286605, -0.3965266854271851, 0.2589445215637863, 0.232864914003593, -0.2537765588921996},
    {0.38035631887393145, 0.31645823884100127, 0.06855970885900332, 0.9301879851097907, 0.4140722042673594, -0.19496828961306248, -0.20431590823409856, -0.17027701901606077},
    {0.42776401920860174, 0.38750341493507057, 0.07318856554471512, 0.9743603406311837, -0.42600250546331436, 0.12110549915521715, -0.2282996587121423, 0.23524009120659067},
    {0.4758461671561308, 0.46209564810117804, 0.07560422012516783, 0.9971223798654412, 0.43203813831871823, -0.04106825777307944, 0.21857296666521978, 0.2066578042678096},
}};
// clang-format on
using Rule = std::span<const Node>;

/// A range of t for a rule, and the variable in which the rule has its nodes.
///
/// Where a slice begins, it is a series in the square root of the distance of t from an end of the range. Such a series
/// is analytic in θ for t = m − h cos θ, the variable as a rule. There may be another root, of the distance from a
/// point that lies beyond the end, but near it. Both are analytic in u for t = end ± near sinh² u.
class Range {
 public:
  double low, high;  ///< of t, or of u
  /// The distances from the ends to the next points with a root, outside of the range.
  double before = std::numeric_limits<double>::infinity(), after = before;
  double end = 0, near = 0;  ///< near is negative if t falls from the end; it is 0 for the variable θ

  /// Where a node is: a step from an end. `rate` is dt/dx of the variable, times 4 / π.
  struct Place {
    double end, step, weight, rate;
  };

  /// The places of a node and of the node at −x, in the order of t.
  std::array<Place, 2> places(const Node& node) const {
    const double width = high - low;
    if (near == 0) {
      const double step = width * node.share, weight = width * node.weight, rate = width * node.sine;
      return {{{low, step, weight, rate}, {high, -step, weight, rate}}};
    }
    const auto place = [&](double u) {
      const double rise = std::sinh(u), slope = 2 * std::abs(near) * rise * std::cosh(u) * width;
      const double share_of_weight = 2 / std::numbers::pi * node.weight / node.sine;
      return Place{end, near * rise * rise, slope * share_of_weight, slope * 2 / std::numbers::pi};
    };
    const double step = width * node.fraction;
    if (near > 0) return {place(low + step), place(high - step)};
    return {place(high - step), place(low + step)};
  }

  /// The ratio of one term of a series to the term before, if both come from a root just beyond an end. They may be
  /// much smaller than the first terms, which fall faster. In x, the root is at 1 + i η. The Bernstein ellipse through
  /// that point has the half axis (η + √(4 + η²)) / 2.
  double fall_by_roots() const {
    const double distance = std::min(before, after);
    if (near != 0 || !(distance > 0 && distance < high - low)) return 0;
    const double beside = 2 / std::numbers::pi * std::acosh(1 + 2 * distance / (high - low));
    const double axis = (beside + std::sqrt(4 + beside * beside)) / 2;
    return axis - std::sqrt(axis * axis - 1);
  }

  bool can_be_halved() const {
    return near != 0 ? high - low > 1e-3 : high - low > 1e-14 * (std::abs(low) + std::abs(high));
  }

  /// The halves, in the order of t. If a root lies near the end of a half, u becomes its variable.
  std::array<Range, 2> halves() const {
    const double middle = low + (high - low) / 2;
    if (near != 0) {
      Range near_end = *this, far = *this;
      near_end.high = far.low = middle;
      return near > 0 ? std::array{near_end, far} : std::array{far, near_end};
    }
    Range below{low, middle, before}, above{middle, high};
    above.after = after;
    below.grade(low, before, 1);
    above.grade(high, after, -1);
    return {below, above};
  }

 private:
  /// Makes u the variable if there is a root so near one end that θ would need many nodes.
  void grade(double from, double distance, double sign) {
    const double width = high - low;
    if (!(distance > 0 && distance < 0.1 * width)) return;
    *this = {0, std::asinh(std::sqrt(width / distance))};
    end = from, near = sign * distance;
  }
};

/// Coefficients in the middle and at the end of a Legendre series, summed over the nodes.
struct Series {
  double last = 0, last_but_one = 0, even = 0, odd = 0;
  void add(const Node& node, double low, double high) {
    last += node.last * (low - high);
    last_but_one += node.last_but_one * (low + high);
    even += node.even * (low + high);
    odd += node.odd * (low - high);
  }
  double tail() const { return std::max(std::abs(last), std::abs(last_but_one)); }
  /// The size of the last terms relative to those in the middle, at most 1.
  double ratio() const {
    const double middle = std::max(std::abs(even), std::abs(odd)), end = tail();
    return end < middle ? end / middle : 1;
  }
  /// A rule of n nodes integrates the first 2 n terms. From the middle to the n-th term, terms fall by the ratio. To
  /// the last one, they fall twice more by that ratio, or faster if the integrand has no singularity nearby.
  double error() const { return 30 * tail() * ratio() * ratio(); }
  /// The error if the element of the area is sharp near an end of the interval. Terms begin at about `whole`. They fall
  /// fast at first, and then as slowly as those of a root. They are taken to fall once more by the ratio, not twice. If
  /// they fell less to the end than to the middle, that fall is less by the square of the same factor.
  double stretched_error(double whole) const {
    const double middle = std::max(std::abs(even), std::abs(odd)), second = ratio();
    const double slowing = middle > 0 ? std::max(1.0, second * whole / middle) : 1;
    return 30 * tail() * std::min(1.0, second * slowing * slowing);
  }
  /// How many times half the nodes are needed until the error is so small, if terms keep falling at this rate.
  double halves_until(double small) const {
    const double now = error();
    if (now <= small) return 0;
    const double each = -2 * std::log(ratio());
    return each > 0 ? std::log(now / small) / each : std::numeric_limits<double>::infinity();
  }
};

}  // namespace overlapper::slicing
