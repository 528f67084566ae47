/* Ray streams, as Embree 3 had them, over the structures of Embree 4. Include <embree4/rtcore.h> first.
 *
 * M rays with a stride, pointers to M rays, or M packets of N rays with a stride; strides count bytes. All rays are traced
 * on the calling thread. The context is handed to filters and to functions of user geometry, and may be NULL. */
#ifndef RTCORE_STREAMS_H
#define RTCORE_STREAMS_H
#ifdef __cplusplus
extern "C" {
#endif
void rtcIntersect1M(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRayHit *rayhit, unsigned int M, size_t byteStride);
void rtcOccluded1M(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRay *ray, unsigned int M, size_t byteStride);
void rtcIntersect1Mp(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRayHit **rayhit, unsigned int M);
void rtcOccluded1Mp(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRay **ray, unsigned int M);
void rtcIntersectNM(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRayHitN *rayhit, unsigned int N, unsigned int M, size_t byteStride);
void rtcOccludedNM(RTCScene scene, struct RTCRayQueryContext *context, struct RTCRayN *ray, unsigned int N, unsigned int M, size_t byteStride);
#ifdef __cplusplus
}
#endif
#endif
