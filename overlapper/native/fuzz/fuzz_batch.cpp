// A harness of libFuzzer for batches. A batch of two to six shapes answers up to three questions: first one after the
// other, then all at once from threads of their own. Every row must have the bits of a batch of its pair alone, and the
// values of the pair's Overlap.

#include <cstring>
#include <map>

#include "batch/batch.h"
#include "batch/parallel.h"
#include "fuzz/fuzzer.h"

namespace overlapper {
namespace {

// -------------------------------------------------------------------------------------------------- bytes to questions

struct Question {
  std::vector<double> positions, orientations;
  std::optional<std::vector<IndexPair>> pairs;
  bool separated;
  double tolerance;
  Method method;
  int threads;

  void place(size_t body, Vec3 p, Quaternion q) {
    std::copy_n(std::array{p.x, p.y, p.z}.begin(), 3, positions.begin() + 3 * body);
    std::copy_n(std::array{q.x, q.y, q.z, q.w}.begin(), 4, orientations.begin() + 4 * body);
  }
  std::span<const double> position(size_t body) const { return std::span(positions).subspan(3 * body, 3); }
  std::span<const double> orientation(size_t body) const { return std::span(orientations).subspan(4 * body, 4); }
};

/// Pairs in any order. A pair may come again, be reversed, or be of one body. A block of 16 pairs has one thread, so
/// two threads need more.
std::vector<IndexPair> draw_pairs(Decoder& decoder, int bodies) {
  std::vector<IndexPair> pairs(decoder.integer(0, 24));
  for (IndexPair& pair : pairs) pair = {decoder.integer(0, bodies - 1), decoder.integer(0, bodies - 1)};
  return pairs;
}

/// The poses of the last question, but for some bodies that have moved.
Question draw_question(Decoder& decoder, const Question& last) {
  Question question = last;
  const int bodies = static_cast<int>(last.positions.size() / 3);
  for (int body = 0; body < bodies; ++body)
    if (decoder.integer(0, 2) == 0) {
      const Vec3 position = decoder.vector();
      question.place(body, position, decoder.orientation());
    } else if (decoder.integer(0, 2) == 0) {
      question.positions[3 * body] += decoder.power_of_two(-52, -1);
    }
  question.pairs.reset();
  if (decoder.integer(0, 3) != 0) question.pairs = draw_pairs(decoder, bodies);
  question.separated = question.pairs && decoder.integer(0, 1) == 0;
  question.tolerance = decoder.integer(0, 3) == 0 ? decoder.tolerance() : last.tolerance;
  question.method = decoder.integer(0, 7) == 0 ? Method::kPaper : Method::kAuto;
  question.threads = decoder.integer(1, 4);
  return question;
}

Question first_question(const std::vector<Placed>& bodies) {
  Question question{
      std::vector<double>(3 * bodies.size()), std::vector<double>(4 * bodies.size()), {}, false, 0.01, {}, 1};
  for (size_t i = 0; i < bodies.size(); ++i) question.place(i, bodies[i].position, bodies[i].orientation);
  return question;
}

// ------------------------------------------------------------------------------------------------------------- answers

/// The answer, or nothing if the question is refused.
std::optional<Overlaps> ask(Batch& batch, const Question& q) try {
  std::optional<std::span<const IndexPair>> pairs;
  if (q.pairs) pairs = *q.pairs;
  bool finished = false;
  Overlaps answer =
      batch.overlaps(q.positions, q.orientations, pairs, q.separated, q.tolerance, q.method, q.threads, finished);
  require(finished, "nobody cancelled");
  // Columns of deferred rows are empty until these are asked for.
  answer.depth = answer.depths(), answer.normal = answer.normals();
  return answer;
} catch (const std::invalid_argument&) {
  return {};
}

bool may_be_refused(const std::vector<Shape>& shapes, const Question& q, IndexPair pair) {
  std::vector<Placed> bodies;
  for (int body : pair) bodies.push_back(make_placed(shapes[body], {}, {}));
  return overlapper::may_be_refused(bodies, q.method == Method::kPaper) || pair[0] == pair[1];
}

/// The question for one pair, asked of a batch of its own.
std::optional<Overlaps> ask_alone(const std::vector<Shape>& shapes, const Question& q, IndexPair pair) {
  Question alone{{}, {}, std::vector<IndexPair>{{0, 1}}, true, q.tolerance, q.method, 1};
  for (int body : pair) {
    alone.positions.insert(alone.positions.end(), q.position(body).begin(), q.position(body).end());
    alone.orientations.insert(alone.orientations.end(), q.orientation(body).begin(), q.orientation(body).end());
  }
  Batch batch({shapes[pair[0]], shapes[pair[1]]});
  return ask(batch, alone);
}

/// The bytes of -0 and 0 differ, those of two NaN may not.
template <class T>
bool same(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void require_same(const Overlaps& a, const Overlaps& b) {
  const auto compare = [&](const auto& column) { require(same(a.*column.values, b.*column.values), column.name); };
  std::apply([&](const auto&... column) { (compare(column), ...); }, kColumns);
}

void require_equal_to_overlap(const Overlaps& row) {
  const std::shared_ptr<Overlap> kept = row.overlap(0);
  const Overlap single(kept->bodies()[0], kept->bodies()[1], row.tolerance, row.method);
  const bool separated = single.status() == Status::kSeparated;
  require(row.status[0] == static_cast<std::int8_t>(single.status()), "the status of the Overlap");
  require(row.volume[0] == single.volume() && row.areas()[0] == single.area(), "the volume and area of the Overlap");
  require(row.volume_error[0] == (separated ? 0 : single.volume_error()), "the volume error of the Overlap");
  if (separated) return;
  const Contact& contact = single.contact();
  require(row.depth[0] == contact.depth && norm(row.normal[0] - contact.normal) == 0, "the contact of the Overlap");
  const std::vector<std::array<double, 6>> gradient = single.gradient();
  require(row.gradient[0][0] == gradient[0] && row.gradient[0][1] == gradient[1], "the gradient of the Overlap");
  if (single.status() != Status::kOverlapping) return;
  require(norm(row.centroid[0] - single.centroid()) == 0, "the centroid of the Overlap");
  const Patch& patch = single.patch();
  const double distance = row.patches().distance[0];
  require(distance == patch.distance || (std::isnan(distance) && std::isnan(patch.distance)),
          "the patch of the Overlap");
}

/// The pairs asked about: those whose boxes meet, if none are named.
std::vector<IndexPair> pairs_of(const std::vector<Shape>& shapes, const Question& question) {
  return question.pairs ? *question.pairs : Batch(shapes).candidate_pairs(question.positions, question.orientations);
}

/// The rows from batches of one pair each; nothing if one of them refuses.
std::optional<Overlaps> expected_of(const std::vector<Shape>& shapes, const Question& question) {
  Overlaps expected;
  std::map<IndexPair, Overlaps> known;
  for (const IndexPair& pair : pairs_of(shapes, question)) {
    if (!known.contains(pair)) {
      const std::optional<Overlaps> alone = ask_alone(shapes, question, pair);
      require(alone || may_be_refused(shapes, question, pair), "only what may be refused is refused");
      if (!alone) return {};
      require_equal_to_overlap(*alone);
      known.emplace(pair, *alone);
    }
    const Overlaps& one = known.at(pair);
    if (!question.separated && one.status[0] == static_cast<std::int8_t>(Status::kSeparated)) continue;
    const auto append = [&](const auto& column) { (expected.*column.values).push_back((one.*column.values)[0]); };
    std::apply([&](const auto&... column) { (append(column), ...); }, kColumns);
    expected.pairs.back() = pair;
  }
  return expected;
}

void require_same(const std::optional<Overlaps>& answer, const std::optional<Overlaps>& expected) {
  require(answer.has_value() == expected.has_value(), "a batch refuses what its pairs refuse");
  if (answer) require_same(*answer, *expected);
}

void run(Decoder& decoder) {
  std::vector<Placed> bodies = decoder.bodies();
  for (int more = decoder.integer(0, 2); more > 0; --more) bodies.push_back(decoder.placed());
  std::vector<Shape> shapes;
  for (const Placed& body : bodies) shapes.push_back(body.shape);
  std::vector<Question> questions{first_question(bodies)};
  for (int more = decoder.integer(0, 2); more > 0; --more)
    questions.push_back(draw_question(decoder, questions.back()));

  std::vector<std::optional<Overlaps>> expected;
  for (const Question& question : questions) expected.push_back(expected_of(shapes, question));
  Batch batch(shapes);
  for (size_t i = 0; i < questions.size(); ++i) require_same(ask(batch, questions[i]), expected[i]);
  std::vector<WaitedFor> callers;
  for (size_t i = 0; i < questions.size(); ++i)
    callers.emplace_back([&, i] { require_same(ask(batch, questions[i]), expected[i]); });
}

}  // namespace
}  // namespace overlapper
