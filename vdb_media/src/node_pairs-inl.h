// Reads a grid's nodes for many cells at once. Included once for each instruction set.
#if defined(BRUME_NODE_PAIRS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef BRUME_NODE_PAIRS_INL_H_
#undef BRUME_NODE_PAIRS_INL_H_
#else
#define BRUME_NODE_PAIRS_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace brume {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Two nodes that are neighbours along x, of as many cells as there are lanes.
template <class Tag>
struct NodePairs {
  hn::Vec<Tag> first, second;
};

// A pair is one load of 64 bits; instructions that gather take twice as long as these (decision
// 14).
#if HWY_TARGET == HWY_SCALAR
template <class Tag, typename Offset>
HWY_INLINE NodePairs<Tag> node_pairs(Tag tag, const float* nodes, const Offset* offset) {
  return {hn::Set(tag, nodes[*offset]), hn::Set(tag, nodes[*offset + 1])};
}
#else
template <class Tag, typename Offset>
HWY_INLINE hn::Vec<Tag> load_pairs(Tag tag, const float* nodes, const Offset* offset) {
  if constexpr (hn::MaxLanes(Tag()) == 2) {
    return hn::LoadU(tag, nodes + *offset);
  } else {
    const hn::Half<Tag> half;
    return hn::Combine(tag, load_pairs(half, nodes, offset + hn::MaxLanes(half) / 2),
                       load_pairs(half, nodes, offset));
  }
}
template <class Tag, typename Offset>
HWY_INLINE NodePairs<Tag> node_pairs(Tag tag, const float* nodes, const Offset* offset) {
  const auto low = load_pairs(tag, nodes, offset),
             high = load_pairs(tag, nodes, offset + hn::MaxLanes(tag) / 2);
  return {hn::ConcatEven(tag, high, low), hn::ConcatOdd(tag, high, low)};
}
#endif

}  // namespace HWY_NAMESPACE
}  // namespace brume
HWY_AFTER_NAMESPACE();

#endif
