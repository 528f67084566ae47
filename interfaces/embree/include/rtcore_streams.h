/* Ray streams, as Embree 3 had them, over the structures of Embree 4. Include <embree4/rtcore.h> first.
 *
 * M rays, each byteStride bytes behind the one before. All rays are traced on the calling thread. The context is handed to
 * filters and to functions of user geometry, and may be NULL. */
#ifndef RTCORE_STREAMS_H
#define RTCORE_STREAMS_H
#ifdef __cplusplus
extern "C" {
#endif
void rtcIntersect1M(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRayHit *rayhit, unsigned int M, size_t byteStride);
void rtcOccluded1M(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRay *ray, unsigned int M, size_t byteStride);
#ifdef __cplusplus
}
#endif
#endif
